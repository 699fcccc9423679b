"""Planners behind one protocol and one registry; verification is separate (`optiplan.verify`)."""
