"""Denavit-Hartenberg tables as robots."""
