import base64

import coal
import numpy as np
import pinocchio as pin
import pytest

from optiplan.geometry.convex_hulls import convex_hull
from optiplan.viewer.surfaces import MAX_TRIANGLES, Surface, bounded, bvh_surface, encode, visual_surfaces


def triangles(encoded: dict) -> np.ndarray:
    steps = np.frombuffer(base64.b64decode(encoded["vertices"]), "<u2").reshape(-1, 3)
    vertices = np.array(encoded["low"]) + encoded["step"] * steps
    return vertices[
        np.frombuffer(base64.b64decode(encoded["faces"]), "<u4" if encoded["wide"] else "<u2").reshape(-1, 3)
    ].astype(float)


def volume(corners: np.ndarray) -> float:
    """Enclosed volume; positive when all triangles are counter-clockwise from outside."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)


def grid(n: int) -> Surface:
    x, y = np.meshgrid(np.linspace(0, 1, n), np.linspace(0, 1, n))
    corner = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    faces = np.concatenate(
        [np.stack(c, 1) for c in ((corner, corner + 1, corner + n), (corner + 1, corner + n + 1, corner + n))]
    )
    return Surface(np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], 1), faces, (1.0, 0.0, 0.0, 1.0))


@pytest.mark.parametrize(
    ("geometry", "expected"),
    [
        (coal.Box(1.0, 2.0, 3.0), {"kind": "box", "size": [1.0, 2.0, 3.0]}),
        (coal.Sphere(0.5), {"kind": "sphere", "radius": 0.5}),
        (coal.Cylinder(0.5, 2.0), {"kind": "cylinder", "radius": 0.5, "length": 2.0}),
        (coal.Capsule(0.5, 2.0), {"kind": "capsule", "radius": 0.5, "length": 2.0}),
        (coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.3), {"kind": "plane", "normal": [0.0, 0.0, 1.0], "offset": 0.3}),
        (coal.Ellipsoid(0.1, 0.2, 0.3), {"kind": "box", "size": [0.2, 0.4, 0.6], "centre": [0.0, 0.0, 0.0]}),
    ],
)
def test_primitives_keep_their_dimensions(geometry, expected):
    found = encode(geometry)
    assert found.keys() == expected.keys()
    assert found["kind"] == expected["kind"]
    for key in expected.keys() - {"kind"}:
        assert found[key] == pytest.approx(expected[key])


def test_hull_is_closed_and_faces_outwards():
    corners = np.array(np.meshgrid([0, 1], [0, 2], [0, 3])).reshape(3, -1).T.astype(float)
    assert volume(triangles(encode(convex_hull(corners)))) == pytest.approx(6.0)


def test_mesh_keeps_its_triangles(tmp_path):
    path = tmp_path / "tetrahedron.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
    mesh = coal.MeshLoader(coal.BV_OBBRSS).load(str(path), np.array([2.0, 2.0, 2.0]))
    assert len(bvh_surface(mesh).faces) == 4
    assert volume(triangles(encode(mesh))) == pytest.approx(8.0 / 6.0)


def test_equal_vertices_are_merged():
    soup = grid(4)
    loose = Surface(soup.vertices[soup.faces].reshape(-1, 3), np.arange(3 * len(soup.faces)).reshape(-1, 3))
    merged = bounded(loose)
    assert len(merged.vertices) == 16
    assert np.allclose(merged.vertices[merged.faces], soup.vertices[soup.faces], atol=1e-6)


def test_equal_triangles_are_one_however_many_there_are():
    corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    assert len(bounded(Surface(corners, np.tile([[0, 1, 2]], (MAX_TRIANGLES + 1, 1)))).faces) == 1


def test_too_many_triangles_become_fewer_and_keep_their_extent():
    fine = grid(160)
    coarse = bounded(fine)
    assert len(fine.faces) > MAX_TRIANGLES >= len(coarse.faces) > 100
    assert np.allclose(np.ptp(coarse.vertices, axis=0), [1.0, 1.0, 0.0], atol=0.02)
    assert coarse.colour == fine.colour


def test_materials_of_an_obj_give_one_surface_a_colour(tmp_path):
    (tmp_path / "two.mtl").write_text("newmtl red\nKd 1 0 0\nnewmtl blue\nKd 0 0 1\n")
    vertices, faces = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n", "f 1 3 2\nf 1 2 4\nusemtl blue\nf 1 4 3\nf 2 3 4\n"
    (tmp_path / "two.obj").write_text("mtllib two.mtl\n" + vertices + "usemtl red\n" + faces)
    thing = visual(tmp_path / "two.obj")
    surfaces = visual_surfaces(thing)
    assert {s.colour: len(s.faces) for s in surfaces} == {(1.0, 0.0, 0.0, 1.0): 2, (0.0, 0.0, 1.0, 1.0): 2}
    assert max(s.vertices.max() for s in surfaces) == pytest.approx(2.0)  # scaled


def test_obj_that_its_reader_refuses_is_drawn_from_what_was_loaded(tmp_path, caplog):
    path = tmp_path / "gone.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    thing = visual(path)
    path.unlink()
    assert [len(s.faces) for s in visual_surfaces(thing)] == [1]
    assert "gone.obj" in caplog.text


def visual(path) -> pin.GeometryObject:
    scale = np.array([2.0, 2.0, 2.0])
    mesh = coal.MeshLoader(coal.BV_OBBRSS).load(str(path), scale)
    return pin.GeometryObject("thing", 0, pin.SE3.Identity(), mesh, str(path), scale, False, np.ones(4))
