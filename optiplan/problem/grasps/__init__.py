"""Grasps of objects and places in regions, as sets of poses that a task may choose from."""
