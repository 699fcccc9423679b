"""What the page shows of a run, as plain data computed from the motion and the problem."""
