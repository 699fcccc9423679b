"""Intervals, paired tests and comparisons of results."""
