"""Convex stand-ins: they cover the mesh, and reach beyond it by no more than is said."""

import coal
import numpy as np
import pinocchio as pin
import pytest
import trimesh

from optiplan.collision.clearance_test import PairMargins
from optiplan.collision.model import CollisionModel
from optiplan.collision.pair_queries import HULL_DISTANCE_ENOUGH
from optiplan.geometry import convex_pieces
from optiplan.geometry.convex import cover_of, faces_of, hull_of, mesh_vertices, protrusion, soup_of
from optiplan.geometry.convex_hulls import covering_hull
from optiplan.geometry.convex_pieces import PieceOptions, cut, measured
from optiplan.geometry.enclosure import winding_number
from optiplan.geometry.over_cover import MeshSolid
from optiplan.geometry.scene import Mesh, Obstacle, Scene
from optiplan.robot.robot import load_robot
from tests.robot.robots import LINK, joint, write_robot


@pytest.fixture(scope="module")
def angle():
    """An L of one surface: 0.4 m by 0.4 m, 0.05 m wide."""
    ring = [[0, 0], [0.4, 0], [0.4, 0.05], [0.05, 0.05], [0.05, 0.4], [0, 0.4]]
    top = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 5], [3, 4, 5]])
    sides = [t for i in range(6) for j in [(i + 1) % 6] for t in ([i, j, j + 6], [i, j + 6, i + 6])]
    points = np.vstack([np.column_stack([ring, np.full(6, z)]) for z in (0.0, 0.05)])
    return trimesh.Trimesh(points, np.vstack([top[:, ::-1], top + 6, sides]), process=False)


def solid_of(mesh):
    return MeshSolid(np.asarray(mesh.vertices)[mesh.faces])


def as_soup(mesh, tmp_path):
    mesh.export(tmp_path / "mesh.stl")
    return soup_of(coal.MeshLoader(coal.BV_OBBRSS).load(str(tmp_path / "mesh.stl")))


def outside(pieces, points):
    """How far points are outside all pieces, (k,), negative inside."""
    return np.min([protrusion(faces_of(piece), points) for piece in pieces], axis=0)


def dense(solid, count, rng):
    corners = solid.triangles[rng.integers(len(solid.triangles), size=count)]
    return np.einsum("ij,ijk->ik", rng.dirichlet(np.ones(3), count), corners)


def test_points_inside_are_those_that_the_surface_winds_around(angle):
    solid = solid_of(angle)
    points = np.random.default_rng(1).uniform(-0.05, 0.45, (400, 3)) * [1, 1, 0.2]
    expected = [abs(winding_number(solid.triangles, point)) > 0.5 for point in points]
    assert solid.inside(points).tolist() == expected
    assert any(expected)
    assert not all(expected)


def test_distance_from_the_surface_is_that_of_coal(angle):
    solid = solid_of(angle)
    points = np.random.default_rng(2).uniform(-0.1, 0.5, (200, 3))
    _, expected, _ = trimesh.proximity.closest_point_naive(angle, points)
    assert np.allclose(solid.nearest(points)[0], expected, atol=1e-9)


def test_over_cover_of_a_hull_is_the_farthest_point_of_its_surface(angle):
    """The hull closes the corner of the L by a slanted face; its middle is 0.175 m from both inner walls."""
    found = measured(solid_of(angle), [np.asarray(angle.vertices)])
    assert 0.175 <= found <= 0.175 + PieceOptions.tolerance


def test_over_cover_of_a_convex_mesh_is_nothing():
    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.1)
    assert measured(solid_of(ball), [np.asarray(ball.vertices)]) < 1e-9


def test_an_angle_is_two_pieces(angle):
    pieces = cut(solid_of(angle))
    assert len(pieces.vertices) == 2
    assert pieces.over_cover <= 1e-3
    filled = sum(trimesh.convex.convex_hull(piece).volume for piece in pieces.vertices)
    assert angle.volume <= filled * (1 + 1e-9) <= (1 + 1e-6) * angle.volume


def rounded():
    """A dumb-bell with round necks: no few convex pieces are exact."""
    z = np.linspace(-0.1, 0.1, 21)
    radius = 0.03 + 0.01 * np.cos(np.pi * z / 0.1) ** 2 * np.sign(np.abs(z) - 0.02)
    ring = np.column_stack([np.concatenate([[0], radius, [0]]), np.concatenate([[-0.1], z, [0.1]])])
    return trimesh.creation.revolve(ring, sections=12)


@pytest.fixture(scope="module")
def dumb_bell():
    solid = solid_of(rounded())
    return solid, cut(solid, PieceOptions(over_cover=2e-3, most=40))


def test_pieces_cover_surface_and_interior(dumb_bell):
    solid, pieces = dumb_bell
    rng = np.random.default_rng(3)
    low, high = solid.triangles.min(axis=(0, 1)), solid.triangles.max(axis=(0, 1))
    everywhere = rng.uniform(low, high, (6000, 3))
    inside = everywhere[solid.inside(everywhere)]
    assert len(inside) > 1000
    assert outside(pieces.vertices, inside).max() <= 1e-9
    assert outside(pieces.vertices, dense(solid, 6000, rng)).max() <= 1e-9


def test_a_mesh_that_needs_too_many_pieces_is_given_up_early(dumb_bell, monkeypatch):
    """Each part whose hull reaches too far counts as two before it is cut; 2 * most + 2 parts are looked at."""
    cuts, own = [], convex_pieces._best_cut
    monkeypatch.setattr(convex_pieces, "_best_cut", lambda *given: cuts.append(1) or own(*given))
    assert cut(dumb_bell[0], PieceOptions(over_cover=1e-4, most=4)) is None
    assert 1 <= len(cuts) <= 6  # depth first it took ten


def test_pieces_reach_no_farther_than_is_said(dumb_bell):
    solid, pieces = dumb_bell
    assert 1 < len(pieces.vertices) <= 40
    assert pieces.over_cover <= 2e-3
    rng = np.random.default_rng(4)
    for piece in pieces.vertices:
        points = dense(MeshSolid(piece[faces_simplices(piece)]), 800, rng)
        away = points[~solid.inside(points)]
        assert solid.nearest(away)[0].max(initial=0.0) <= pieces.over_cover + 1e-9


def faces_simplices(points):
    from scipy.spatial import ConvexHull

    return ConvexHull(points).simplices


def test_a_mesh_that_needs_too_many_pieces_is_not_cut(dumb_bell):
    assert cut(dumb_bell[0], PieceOptions(over_cover=1e-4, most=4)) is None


def test_cover_is_hull_pieces_or_mesh(angle, tmp_path):
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.1)
    screw = trimesh.creation.torus(0.1, 0.03, major_sections=24, minor_sections=8)
    found = [cover_of(as_soup(mesh, tmp_path)) for mesh in (ball, angle, screw)]
    assert [cover.kind for cover in found] == ["hull", "convex_pieces", "mesh"]
    assert [len(cover.pieces) for cover in found] == [1, 2, 0]
    assert all(cover.over_cover <= 1e-3 for cover in found)
    assert found[2].hull == pytest.approx(0.07 - 0.03, abs=0.04)


def test_cover_is_kept_by_content(angle, tmp_path, monkeypatch):
    first = cover_of(as_soup(angle, tmp_path))
    monkeypatch.setattr("optiplan.geometry.convex_pieces.cut", lambda *_: pytest.fail("cut again"))
    again = cover_of(as_soup(angle, tmp_path))
    assert all(np.array_equal(a, b) for a, b in zip(first.pieces, again.pieces, strict=True))
    assert (first.over_cover, first.hull) == (again.over_cover, again.hull)


def test_auto_is_the_default_of_robot_files(angle, tmp_path):
    angle.export(tmp_path / "angle.stl")
    mesh = f'<link name="m"><collision><geometry><mesh filename="{tmp_path}/angle.stl"/></geometry></collision></link>'
    robot = load_robot(str(write_robot(tmp_path / "r", [LINK.format("a"), mesh, joint("j1", "a", "m")])))
    assert robot.link_geometry == {"a": "primitive", "m": "convex_pieces"}
    assert robot.over_cover["m"] <= 1e-3
    assert robot.geometry.ngeoms == 3
    assert any(note.startswith("m_0: 2 convex pieces") for note in robot.notes)


@pytest.mark.parametrize("case", ["circle", "thin", "almost"])
def test_hulls_that_coal_cannot_build_are_covered(case):
    """A prism over 4,000 corners, 3,000 points within a few nanometres of a plane, a square bent by 10 nm."""
    rng = np.random.default_rng(5)
    turn = 2.0 * np.pi * np.arange(4000) / 4000
    ring = np.column_stack([np.cos(turn), np.sin(turn)]).round(9)
    points = {
        "circle": np.vstack([np.column_stack([ring, np.full(4000, z)]) for z in (0.0, 1.0)]),
        "thin": rng.standard_normal((3000, 3)) * [1.5, 1.5, 2e-9],
        "almost": np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 1e-8]]),
    }[case]
    hull = covering_hull(points)
    body = hull.build()
    edges = np.unique(np.sort(hull.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)
    assert np.bincount(edges.ravel()).max() <= 255
    assert body.num_points == len(hull.vertices)
    assert 0.0 < hull.over_cover < 1e-3
    directions = rng.standard_normal((500, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    beyond = (directions @ hull.vertices.T).max(axis=1) - (directions @ points.T).max(axis=1)
    assert beyond.min() >= 0.0
    assert beyond.max() <= hull.over_cover + 1e-9
    result = coal.DistanceResult()
    far = coal.Transform3s(np.eye(3), np.array([10.0, 0.0, 0.5]))
    distance = coal.distance(body, coal.Transform3s(), coal.Sphere(0.5), far, coal.DistanceRequest(), result)
    assert distance == pytest.approx(9.5 - hull.vertices[:, 0].max(), abs=0.6)


def test_a_plain_hull_is_exact():
    points = np.random.default_rng(6).standard_normal((300, 3))
    hull = covering_hull(points)
    assert hull.over_cover == 0.0
    assert np.array_equal(np.unique(hull.vertices, axis=0), np.unique(vertices_of_hull(points), axis=0))


def vertices_of_hull(points):
    from scipy.spatial import ConvexHull

    return points[ConvexHull(points).vertices]


def test_links_of_the_fetch_are_within_a_millimetre(shared, tmp_path):
    """Every link of the data set's Fetch, with `auto`: the figure is measured and holds."""
    folder = shared / "robots" / "mbm_fetch" / "meshes"
    for name in ("wrist_flex_link_collision_2.stl", "elbow_flex_link_collision_2.stl", "gripper_link_2.stl"):
        mesh = coal.MeshLoader(coal.BV_OBBRSS).load(str(folder / name))
        cover = cover_of(soup_of(mesh))
        assert cover.kind in ("hull", "convex_pieces")
        assert cover.over_cover <= 1e-3
        bodies = [vertices_of_hull(piece) for piece in cover.pieces]
        assert outside(bodies, mesh_vertices(mesh)).max() <= 1e-9
        assert hull_of(bodies[0]).num_points == len(bodies[0])


@pytest.fixture
def bent_scene(tmp_path, angle):
    """A robot beside an L-shaped mesh, which is far from convex."""
    angle.export(tmp_path / "angle.stl")
    robot = load_robot("planar2r")
    obstacle = Obstacle("angle", Mesh(tmp_path / "angle.stl"), pin.SE3(np.eye(3), np.array([0.7, 0.1, -0.02])))
    return CollisionModel(robot, Scene((obstacle,)))


def configurations(model, count):
    rng = np.random.default_rng(7)
    return rng.uniform(model.robot.limits.lower, model.robot.limits.upper, (count, model.robot.n))


def test_hulls_stand_for_meshes_where_they_are_far_apart(bent_scene):
    """Distances are the meshes' where hulls are near, else lower bounds; where bodies touch, hulls show the way."""
    model, kinds = bent_scene, set()
    Q = configurations(model, 2000)
    found = model.near(Q, 0.1)
    meshes = [k for k, pair in enumerate(model.pairs) if "angle" in (pair.name_a, pair.name_b)]
    for row, q in enumerate(Q):
        model.place(q)
        for pair in meshes:
            exact, hull = model.pair_distance(pair).distance, model.outline.query(pair).min_distance
            near = found.distance[(found.rows == row) & (found.pairs == pair)]
            told = hull if hull > HULL_DISTANCE_ENOUGH or exact <= 0.0 else exact
            assert near.tolist() == ([told] if told < 0.1 else [])
            assert told <= exact + 1e-6
            gap = model.pair_gap(pair)
            assert gap <= exact + 1e-6
            assert gap == exact or gap > HULL_DISTANCE_ENOUGH - 1e-5
            kinds.add("hull" if hull > HULL_DISTANCE_ENOUGH else "touch" if exact <= 0.0 else "mesh")
    assert kinds == {"hull", "touch", "mesh"}


def test_meshes_decide_whether_bodies_touch_and_which_are_nearest(bent_scene):
    model, seen = bent_scene, set()
    for q in configurations(model, 200):
        gaps = [model.distance(q, pair).distance for pair in range(len(model.pairs))]
        assert model.collides(q) == (min(gaps) <= 0.0)
        assert model.clearance(q).distance == min(gaps)
        near = model.contacts(q, 0.1)
        assert [contact.distance for contact in near] == [gap for gap in gaps if gap < 0.1]
        seen.add(model.collides(q))
    assert seen == {True, False}


@pytest.mark.parametrize("margin", [0.0, 0.004, 0.02, 0.1])
def test_margins_are_held_against_hulls_only_where_they_are_wide(bent_scene, margin):
    """What is said to be apart is; what is said to be near is, except that wide margins look at hulls."""
    model, margins, seen = bent_scene, PairMargins(bent_scene), set()
    margins.set(np.full(len(model.pairs), margin))
    for q in configurations(model, 200):
        gaps = [model.distance(q, pair).distance for pair in range(len(model.pairs))]
        if abs(min(gaps) - margin) < 1e-5:
            continue
        near = margins.near(q)
        hulls = min(model.outline.query(pair).min_distance for pair in range(len(model.pairs)))
        assert near == (min(gaps) < margin if margin < 0.03 else hulls < margin)
        seen.add(near)
    assert seen == {True, False}


def test_a_link_of_the_ur5_is_not_its_hull(shared):
    """The hull of wrist 3 reaches 7 mm beyond it."""
    path = shared / "robots" / "mbm_ur5" / "meshes" / "ur5" / "collision" / "wrist3.stl"
    cover = cover_of(soup_of(coal.MeshLoader(coal.BV_OBBRSS).load(str(path))))
    assert cover.kind in ("convex_pieces", "mesh")
    assert cover.over_cover <= 1e-3
    assert cover.hull == pytest.approx(0.0067, abs=3e-4)


def test_a_lone_triangle_beside_a_body_is_covered():
    """Triangles without volume are pieces of their own, or parts of others."""
    box = trimesh.creation.box((0.1, 0.1, 0.1))
    alone = np.array([[[0.3, 0, 0], [0.35, 0.02, 0.013], [0.3, 0.05, 0.02]]])
    solid = MeshSolid(np.concatenate([box.triangles, alone]))
    pieces = cut(solid)
    bodies = [np.asarray(hull_of(piece).points()) for piece in pieces.vertices]
    assert outside(bodies, dense(solid, 2000, np.random.default_rng(8))).max() <= 1e-9
