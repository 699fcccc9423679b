"""Benchmarks: a suite file names problems and planners; every run is a row of one database.

See docs/how-to/benchmarks.md.
"""
