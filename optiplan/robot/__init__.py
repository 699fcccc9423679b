"""Robots: description files, joint groups, limits, link geometry, pairs of links that need no check."""
