"""Kinematics and dynamics of a robot for many configurations at once."""
