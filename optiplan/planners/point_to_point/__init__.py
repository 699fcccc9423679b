"""Planners of one time law from start to goal."""
