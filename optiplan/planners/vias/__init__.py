"""Planners of a curve through via points."""
