"""Hulls of the parts of a mesh together hold it."""

import numpy as np

from optiplan.geometry.convex_hulls import solid_hull
from optiplan.geometry.meshes import mesh_parts
from optiplan.geometry.meshes.triangles import Soup
from tests.geometry.horseshoe import horseshoe


def test_parts_hold_every_triangle() -> None:
    mesh = Soup(*horseshoe())
    parts = mesh_parts.parts_of_mesh(mesh)
    assert len(parts) == mesh_parts._PARTS
    assert parts is mesh_parts.parts_of_mesh(Soup(*horseshoe()))
    n = np.random.default_rng(0).normal(size=(300, 3))
    heights = [(n @ part.vertices.T).max(axis=1) for part in parts]
    for triangle in mesh.vertices[mesh.triangles]:
        own = (n @ triangle.T).max(axis=1)
        assert any((own <= height + 1e-12).all() for height in heights)


def test_parts_leave_the_bend_free() -> None:
    """The hull of the whole fills it."""
    parts = mesh_parts.parts_of_mesh(Soup(*horseshoe()))
    n = np.random.default_rng(1).normal(size=(500, 3))
    n /= np.linalg.norm(n, axis=1)[:, None]
    beyond = [(n @ np.array([0.0, 0.15, 0.0]) - (n @ part.vertices.T).max(axis=1)).max() for part in parts]
    assert min(beyond) > 0.05


def test_a_mesh_in_a_plane_has_parts() -> None:
    corners = np.array([[x, y, 0.0] for x in range(4) for y in range(3)], float)
    triangles = np.array([[0, 1, 4], [0, 4, 3], [3, 4, 7], [3, 7, 6]])
    parts = list(mesh_parts._cut(Soup(corners, triangles)))
    assert len(parts) == 4
    for part in parts:
        assert np.ptp(solid_hull(part).vertices, axis=0).min() > 0.0
