"""Viewer of runs in a browser: a meshcat scene inside our own page, served locally or written as one file."""
