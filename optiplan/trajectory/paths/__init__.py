"""Geometric curves through points."""
