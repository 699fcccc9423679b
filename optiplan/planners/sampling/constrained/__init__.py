"""Searches for paths that hold path constraints: samples are projected, edges are walked with projected steps."""
