"""Closed loops: a reference, a controller and a plant, run together, and the log of what happened."""
