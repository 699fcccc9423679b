"""Proved lower bounds on the duration of any motion of a problem, obstacles included."""
