"""The program of a curve as one nonlinear program of CasADi, for solvers of `casadi.nlpsol`."""
