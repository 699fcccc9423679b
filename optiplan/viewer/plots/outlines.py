"""Outlines of a scene's obstacles, seen along an axis of the world."""

from collections.abc import Iterator

import numpy as np
from scipy.spatial import ConvexHull

from optiplan.arrays import Array
from optiplan.geometry.scene import Scene
from optiplan.geometry.shapes import build_geometry
from optiplan.viewer.body_triangles import body_triangles

FLAT = 1e-9
"""m: thinner outlines are lines, which have no area to fill."""


def outlines(scene: Scene, plane: tuple[int, int]) -> Iterator[Array]:
    """Convex outlines (k, 2), m, of the obstacles in two coordinates of the world; half-spaces have none."""
    for obstacle in scene.obstacles:
        if obstacle.shape.endless:
            continue
        vertices = body_triangles(build_geometry(obstacle.shape)).vertices
        X_WO = obstacle.X_WO
        points = (vertices @ X_WO.rotation.T + X_WO.translation)[:, plane]
        if np.ptp(points, axis=0).min() > FLAT:
            yield points[ConvexHull(points).vertices]
