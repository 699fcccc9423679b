"""Figures of a lecture: time laws, accuracy and repeatability, singularities, vias step by step."""
