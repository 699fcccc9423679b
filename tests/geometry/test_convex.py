import coal
import numpy as np
import pytest
import trimesh

from optiplan.geometry.convex import CoacdOptions, faces_of, hull_of, mesh_vertices, pieces_of, protrusion, soup_of
from optiplan.geometry.meshes.triangles import Soup
from optiplan.robot.robot import load_robot
from tests.robot.robots import LINK, joint, write_robot

pytestmark = pytest.mark.usefixtures("own_cache")


@pytest.fixture
def angle(tmp_path):
    """An L of two bars, a mesh that is far from convex."""
    path = tmp_path / "angle.stl"
    bars = [
        trimesh.creation.box((0.4, 0.05, 0.05)),
        trimesh.creation.box((0.05, 0.4, 0.05)).apply_translation([0.225, 0.175, 0]),
    ]
    trimesh.util.concatenate(bars).export(path)
    return path


def load(path):
    return coal.MeshLoader(coal.BV_OBBRSS).load(str(path))


def dense(mesh, count=4000):
    """Points on the triangles of a mesh."""
    vertices = mesh_vertices(mesh)
    rng = np.random.default_rng(0)
    corners = np.array([[vertices[mesh.tri_indices(i)[k]] for k in range(3)] for i in range(mesh.num_tris)])
    weights = rng.dirichlet(np.ones(3), count)
    return np.einsum("ij,ijk->ik", weights, corners[rng.integers(len(corners), size=count)])


def test_a_hull_contains_every_vertex_and_no_more(angle):
    mesh = load(angle)
    hull = hull_of(mesh_vertices(mesh))
    corners = np.asarray(hull.points())
    out = protrusion(faces_of(corners), mesh_vertices(mesh))
    assert out.max() < 1e-9
    assert {tuple(p) for p in corners.round(9)} <= {tuple(p) for p in mesh_vertices(mesh).round(9)}


@pytest.mark.parametrize("points", [[[0, 0, 0]], [[0, 0, 0], [1, 0, 0]], [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]])
def test_flat_meshes_get_a_thin_hull(points):
    hull = hull_of(np.array(points, float))
    corners = np.asarray(hull.points())
    assert protrusion(faces_of(corners), np.array(points, float)).max() <= 0
    assert np.ptp(corners[:, 2]) <= 3e-5


@pytest.mark.parametrize("points", [np.zeros((0, 3)), np.array([[0, 0, np.nan], [1, 0, 0], [0, 1, 0], [0, 0, 1]])])
def test_no_hull_of_nothing(points):
    with pytest.raises(ValueError, match="without finite vertices"):
        hull_of(points)


def test_pieces_contain_the_mesh_and_leave_its_hollow_free(angle):
    mesh = load(angle)
    pieces = pieces_of(soup_of(mesh))
    bodies = [faces_of(piece) for piece in pieces.vertices]
    assert len(bodies) > 1
    sticking_out = np.min([protrusion(faces, dense(mesh)) for faces in bodies], axis=0)
    assert sticking_out.max() < 1e-9
    hollow = np.array([[0.0, 0.2, 0.0], [0.1, 0.1, 0.0]])
    assert np.min([protrusion(faces, hollow) for faces in bodies], axis=0).min() > 0.02
    for rough in pieces.vertices:
        assert protrusion(faces_of(mesh_vertices(mesh)), rough).max() < 0.01  # grown little beyond the hull
    assert 0 <= pieces.growth < 0.01


def test_a_mesh_in_a_plane_has_pieces():
    turn = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]
    angle = np.array([[0, 0, 0], [30, 0, 0], [30, 2, 0], [2, 2, 0], [2, 30, 0], [0, 30, 0]]) / 100.0 @ turn
    pieces = pieces_of(Soup(angle, np.array([[0, 1, 2], [0, 2, 3], [0, 3, 5], [3, 4, 5]])))
    hollow = np.array([[0.2, 0.2, 0.0]]) @ turn
    out = np.min([protrusion(faces_of(piece), np.vstack([angle, hollow])) for piece in pieces.vertices], axis=0)
    assert out[:-1].max() <= 1e-9
    assert out[-1] > 0.05
    assert 0.0 < pieces.growth <= 2e-5


def test_a_convex_mesh_is_one_piece(tmp_path):
    trimesh.creation.icosphere(subdivisions=2, radius=0.1).export(tmp_path / "ball.stl")
    assert len(pieces_of(soup_of(load(tmp_path / "ball.stl"))).vertices) == 1


def test_a_robot_file_may_ask_for_pieces_of_a_convex_mesh(tmp_path):
    trimesh.creation.icosphere(subdivisions=1, radius=0.1).export(tmp_path / "ball.stl")
    mesh = f'<link name="m"><collision><geometry><mesh filename="{tmp_path}/ball.stl"/></geometry></collision></link>'
    parts = [LINK.format("a"), mesh, joint("j1", "a", "m")]
    robot = load_robot(str(write_robot(tmp_path / "r", parts, "collision: convex_pieces\n")))
    assert "m_0: its hull, which pieces nearly fill; reaches at most 0 mm beyond the mesh" in robot.notes


def test_pieces_are_kept_by_mesh_and_options(angle, own_cache, monkeypatch):
    first = pieces_of(soup_of(load(angle)))
    assert len(list(own_cache.glob("pieces/*.npz"))) == 1
    monkeypatch.setattr("optiplan.geometry.convex._cut", lambda *_: pytest.fail("cut again"))
    again = pieces_of(soup_of(load(angle)))
    assert again.growth == first.growth
    assert all(np.array_equal(a, b) for a, b in zip(first.vertices, again.vertices, strict=True))
    mesh = soup_of(load(angle))
    for other, options in ((mesh.vertices, CoacdOptions(threshold=0.2)), (1.001 * mesh.vertices, CoacdOptions())):
        with pytest.raises(pytest.fail.Exception):
            pieces_of(Soup(other, mesh.triangles), options)


@pytest.mark.parametrize(
    ("collision", "kind", "bodies"), [("mesh", "mesh", 1), ("{mesh: [a], convex_pieces: [m]}", "convex_pieces", 2)]
)
def test_each_link_as_the_robot_file_says(angle, tmp_path, collision, kind, bodies):
    mesh = f'<link name="m"><collision><geometry><mesh filename="{angle}"/></geometry></collision></link>'
    parts = [LINK.format("a"), mesh, joint("j1", "a", "m")]
    robot = load_robot(str(write_robot(tmp_path / "r", parts, f"collision: {collision}\n")))
    assert robot.link_geometry == {"a": "primitive", "m": kind}
    shapes = [item.geometry for i, item in enumerate(robot.geometry.geometryObjects) if robot.link_of(i) == "m"]
    assert len(shapes) >= bodies
    assert all(isinstance(shape, coal.BVHModelBase) == (kind == "mesh") for shape in shapes)
    assert len({item.name for item in robot.geometry.geometryObjects}) == robot.geometry.ngeoms
    assert bool([note for note in robot.notes if "convex pieces" in note]) == (kind == "convex_pieces")
