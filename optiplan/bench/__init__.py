"""Benchmarks: a suite file names problems and planners, every run of it is a row of one database.

See docs/how-to/benchmarks.md.
"""
