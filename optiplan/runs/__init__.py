"""Runs: planning and verification, metrics, the run folder."""
