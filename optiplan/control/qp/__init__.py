"""The quadratic program of a step: its assembly, its solvers, what is done where it has no solution."""
