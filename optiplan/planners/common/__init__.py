"""Modules shared by planners of several families."""
