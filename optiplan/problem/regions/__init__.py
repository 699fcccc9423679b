"""Regions of poses as goals: what one is, and how a problem file says it."""
