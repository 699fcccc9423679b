"""Checks of paths of the tool."""
