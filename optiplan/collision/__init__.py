"""Collision queries of a robot in a scene."""
