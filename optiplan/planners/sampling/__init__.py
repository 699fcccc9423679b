"""Sampling-based planners."""
