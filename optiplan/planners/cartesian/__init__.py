"""Planners that prescribe the tool's path: `path` is the geometry, `follow` turns it into joint motion."""
