"""Scene graphs of mesh files: nodes that place geometries, and the upward axis."""

from collections.abc import Iterable

import numpy as np

from optiplan.arrays import Array
from optiplan.geometry.meshes.triangles import MOST_TRIANGLES, MeshError, Soup, Triangles

MOST_NODES = 100_000
"""Nodes of a scene, each instance counted."""

DEEPEST = 200
"""Levels of nested nodes."""

TURNS = {
    "X_UP": np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]]),
    "Y_UP": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]),
    "Z_UP": np.eye(3),
}
"""Rotations from the axes of COLLADA (right, up, inward) by upward axis to z up, x right and y inward."""

MeshPart = tuple[Array, Triangles]


def joined(parts: Iterable[MeshPart]) -> MeshPart:
    """Return several geometries as one."""
    vertices, triangles = [np.empty((0, 3))], [np.empty((0, 3), np.int64)]
    for points, corners in parts:
        triangles.append(corners + sum(map(len, vertices)))
        vertices.append(points)
    return np.concatenate(vertices), np.concatenate(triangles)


class PlacedMesh:
    """Placed geometries of a scene, with limits of their number."""

    def __init__(self) -> None:
        self.parts: list[MeshPart] = []
        self.nodes = self.triangles = 0

    def enter(self, depth: int) -> None:
        """Count a node."""
        self.nodes += 1
        if self.nodes > MOST_NODES or depth > DEEPEST:
            what = f"nodes {DEEPEST} deep within each other" if depth > DEEPEST else f"more than {MOST_NODES} nodes"
            raise MeshError(f"{what}: a scene that contains itself, or is too large")

    def add(self, X: Array, part: MeshPart) -> None:
        """Place a geometry at X, (4, 4)."""
        vertices, triangles = part
        self.triangles += len(triangles)
        if self.triangles > MOST_TRIANGLES:
            raise MeshError(f"more than {MOST_TRIANGLES} triangles")
        turned = triangles if np.linalg.det(X[:3, :3]) > 0.0 else triangles[:, ::-1]
        self.parts.append((vertices @ X[:3, :3].T + X[:3, 3], turned))

    def soup(self, scale: float, turn: Array) -> Soup:
        """Return the whole scene, times `scale`."""
        if not self.parts:
            raise MeshError("a scene without triangles")
        vertices, triangles = joined(self.parts)
        return Soup(scale * vertices, triangles, turn)


def strip(indices: Triangles) -> list[list[int]]:
    """Return the triangles of a strip, all wound alike."""
    names = [int(index) for index in indices]
    return [
        [names[i], names[i + 1], names[i + 2]] if i % 2 == 0 else [names[i + 1], names[i], names[i + 2]]
        for i in range(len(names) - 2)
    ]


def fan(indices: Triangles) -> list[list[int]]:
    """Return the triangles of a fan about its first vertex."""
    names = [int(index) for index in indices]
    return [[names[0], names[i], names[i + 1]] for i in range(1, len(names) - 1)]
