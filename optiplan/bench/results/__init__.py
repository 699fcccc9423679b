"""Stored results, and their formats for other programs."""
