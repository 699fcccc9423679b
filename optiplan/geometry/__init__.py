"""Shapes, scenes, poses, meshes and convex bodies that cover them; independent of robots."""
