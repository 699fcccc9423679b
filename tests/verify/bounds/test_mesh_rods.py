"""Rods inside meshes."""

import numpy as np

from optiplan.geometry.coal_queries import coal_mesh
from optiplan.verify.bounds.mesh_rods import mesh_rods

SIGNS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=np.float64)
FACES = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
HALF = np.array([0.3, 0.06, 0.05])


def test_rods_of_a_long_box_lie_in_it_and_reach_along_it():
    triangles = np.array([[f[0], f[k], f[k + 1]] for f in FACES for k in (1, 2)])
    rods = mesh_rods(coal_mesh(SIGNS * HALF, triangles))
    assert rods
    for ends, radius in rods:
        assert (np.abs(ends) + radius <= HALF + 1e-9).all()
    assert max(np.linalg.norm(ends[1] - ends[0]) for ends, _ in rods) > 0.4


def test_a_mesh_with_a_hole_has_no_rods():
    triangles = np.array([[f[0], f[k], f[k + 1]] for f in FACES for k in (1, 2)])
    assert mesh_rods(coal_mesh(SIGNS * HALF, triangles[:-2])) == []
    soup = (SIGNS * HALF)[triangles].reshape(-1, 3)
    assert mesh_rods(coal_mesh(soup, np.arange(len(soup)).reshape(-1, 3))), "corners that several triangles own"


def test_a_mesh_with_a_triangle_turned_inside_out_has_no_rods():
    triangles = np.array([[f[0], f[k], f[k + 1]] for f in FACES for k in (1, 2)])
    triangles[0] = triangles[0, ::-1]
    assert mesh_rods(coal_mesh(SIGNS * HALF, triangles)) == []
