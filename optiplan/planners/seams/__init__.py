"""Paths of the tool at a held speed: postures chosen on a ladder of configurations, smoothed and timed."""
