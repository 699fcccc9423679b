"""Verification of trajectories: checks and the continuous-time certificate; the only source of *verified*."""
