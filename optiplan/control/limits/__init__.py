"""Limits: what a controller never does, each as bounds or rows of the quadratic program."""
