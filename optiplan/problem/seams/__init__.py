"""Paths of the tool: curves with the tool's axis along them, and how they are read, woven and made of surfaces."""
