"""The loop that gives the set-points of an executor to a driver."""
