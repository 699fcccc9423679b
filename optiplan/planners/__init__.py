"""Planners behind one protocol and one registry; none of them marks its own work."""
