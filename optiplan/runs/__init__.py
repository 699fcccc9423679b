"""Runs: planning meets verification, measures, the folder on disk."""
