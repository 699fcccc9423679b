"""Workspaces shown: a page in three dimensions, points for other programs, a section as a picture."""
