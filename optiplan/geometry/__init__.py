"""Shapes, scenes, poses, meshes and their convex stand-ins; nothing here knows a robot."""
