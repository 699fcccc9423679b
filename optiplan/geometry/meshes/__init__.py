"""Mesh files as arrays, read strictly in a process of its own."""
