"""Robots in MuJoCo's MJCF."""
