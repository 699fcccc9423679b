"""The time law along a given path, and bounds on durations."""
