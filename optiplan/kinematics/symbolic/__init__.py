"""The robot as CasADi expressions."""
