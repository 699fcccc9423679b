"""Objectives: their weights, and what a motion costs by each."""
