"""Suites: which problems, which planners, how often."""
