"""Runs of a suite, each in a process under limits."""
