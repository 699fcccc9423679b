"""What an optimised curve has to hold and what it costs: contacts, torques, jerk, and CasADi expressions."""
