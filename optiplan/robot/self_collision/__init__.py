"""Pairs of links: which need a check, measured and proved."""
