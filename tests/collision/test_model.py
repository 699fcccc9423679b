"""Collision queries, bounds that need no query, and the gradient of the distance."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from optiplan.collision.clearance_test import PairMargins
from optiplan.collision.model import CollisionModel
from optiplan.geometry.convex_hulls import convex_hull
from optiplan.geometry.scene import Attachment, Box, Capsule, Cylinder, HalfSpace, Mesh, Obstacle, Scene, Sphere
from optiplan.geometry.shapes import build_geometry
from optiplan.robot.batched.kinematics import BatchKinematics
from optiplan.robot.robot import Robot, load_robot

SHAPES = [Box((0.2, 0.3, 0.1)), Sphere(0.12), Cylinder(0.1, 0.3), Capsule(0.08, 0.2)]


@pytest.fixture(scope="module")
def panda() -> Robot:
    return load_robot("panda")


@pytest.fixture(scope="module")
def model(panda: Robot) -> CollisionModel:
    rng = np.random.default_rng(3)
    obstacles = [
        Obstacle(
            f"o{k}", shape, pin.SE3(pin.exp3(rng.normal(size=3)), np.array([0, 0, 0.4]) + rng.uniform(-0.6, 0.6, 3))
        )
        for k, shape in enumerate(SHAPES)
    ]
    floor = Obstacle("floor", HalfSpace((0.0, 0.0, 1.0), -0.1), pin.SE3.Identity())
    held = Attachment("part", Box((0.05, 0.05, 0.2)), "panda_hand", pin.SE3(np.eye(3), np.array([0, 0, 0.2])))
    return CollisionModel(panda, Scene((*obstacles, floor), (held,)))


def random_q(robot: Robot, count: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(robot.limits.lower, robot.limits.upper, (count, robot.n))


def test_batch_kinematics_equals_pinocchio(panda: Robot) -> None:
    Q = random_q(panda, 50)
    poses = BatchKinematics(panda.model).poses(Q)
    data = panda.model.createData()
    for q, pose in zip(Q, poses, strict=True):
        pin.forwardKinematics(panda.model, data, q)
        np.testing.assert_allclose(pose, [M.homogeneous for M in data.oMi], atol=1e-12)


def test_pairs_name_what_can_touch(model: CollisionModel) -> None:
    names = {frozenset((p.name_a, p.name_b)) for p in model.pairs}
    assert {"part", "floor"} in names
    assert {"panda_link7", "o0"} in names
    assert not any("panda_link0" in pair and "floor" in pair for pair in names)  # both stand still
    assert not any({"part", "panda_hand"} == pair for pair in names)  # held by it


def test_allowed_and_touching_pairs_are_left_out(panda: Robot) -> None:
    ball = Obstacle("ball", Sphere(0.1), pin.SE3.Identity())
    held = Attachment("part", Sphere(0.01), "panda_hand", pin.SE3.Identity(), frozenset({"panda_leftfinger"}))
    allowed = frozenset({frozenset({"ball", "panda_link3"}), frozenset({"part", "ball"})})
    names = {frozenset((p.name_a, p.name_b)) for p in CollisionModel(panda, Scene((ball,), (held,), allowed)).pairs}
    assert frozenset({"ball", "panda_link3"}) not in names
    assert frozenset({"ball", "part"}) not in names
    assert frozenset({"part", "panda_leftfinger"}) not in names
    assert frozenset({"part", "panda_rightfinger"}) in names


def test_collides_agrees_with_the_distances(model: CollisionModel, panda: Robot) -> None:
    seen = set()
    for q in random_q(panda, 200):
        contact = model.clearance(q)
        assert contact is not None
        if abs(contact.distance) > 1e-5:
            assert model.collides(q) == (contact.distance < 0.0)
            seen.add(contact.distance < 0.0)
    assert seen == {True, False}


def test_lower_bounds_hold_for_every_pair(model: CollisionModel, panda: Robot) -> None:
    Q = random_q(panda, 60, seed=1)
    bounds = model.lower_bounds(Q)
    for q, bound in zip(Q, bounds, strict=True):
        model.place(q)
        exact = np.array([model.pair_distance(k).distance for k in range(len(model.pairs))])
        apart = exact > 0.0
        assert (bound[apart] <= exact[apart] + 2e-6).all()
        assert (bound[~apart] <= 0.0).all()


def test_travel_bounds_the_change_of_every_distance(model: CollisionModel, panda: Robot) -> None:
    rng = np.random.default_rng(5)
    tight = []
    for q in random_q(panda, 12, seed=2):
        D = rng.uniform(0.0, 0.2, panda.n) * (rng.random(panda.n) < 0.5)
        bound = model.travel(q[None], D[None])[0]
        model.place(q)
        before = np.array([model.pair_distance(k).distance for k in range(len(model.pairs))])
        for _ in range(20):
            model.place(q + rng.uniform(-D, D))
            after = np.array([model.pair_distance(k).distance for k in range(len(model.pairs))])
            apart = (before > 0.0) & (after > 0.0)
            change = np.abs(after - before)[apart]
            assert (change <= bound[apart] + 2e-6).all()
            tight.append(float((change / np.maximum(bound[apart], 1e-9)).max()))
    assert max(tight) > 0.3  # a bound that is never approached would prove nothing in practice


def test_travel_of_chosen_pairs_equals_travel_of_all(model: CollisionModel, panda: Robot) -> None:
    Q, D = random_q(panda, 4), np.full((4, panda.n), 0.01)
    every = model.travel(Q, D)
    rows, pairs = np.array([0, 2, 3]), np.array([5, 1, 7])
    np.testing.assert_allclose(model.bounds.travel_of(Q, D, rows, pairs), every[rows, pairs])


def test_gradient_of_the_distance_equals_differences(model: CollisionModel, panda: Robot) -> None:
    step, checked = 1e-3, 0
    for q in random_q(panda, 10, seed=4):
        found = model.near(q[None], 0.5)
        for pair, distance, gradient in zip(found.pairs, found.distance, model.gradients(q[None], found), strict=True):
            if abs(distance) < 0.005:  # the differences would cross from apart to inside
                continue
            differences = np.array(
                [
                    (model.distance(q + e, int(pair)).distance - model.distance(q - e, int(pair)).distance) / (2 * step)
                    for e in np.eye(panda.n) * step
                ]
            )
            error = np.abs(gradient - differences)
            checked += int(error.max() < 1e-3 * max(1.0, np.abs(differences).max()))
            assert np.median(error) < 1e-3
    assert checked > 50


def test_answers_do_not_depend_on_what_was_asked_before(model: CollisionModel, panda: Robot) -> None:
    Q = random_q(panda, 20, seed=8)
    forth = [[model.distance(q, k).distance for k in range(len(model.pairs))] for q in Q]
    back = [[model.distance(q, k).distance for k in range(len(model.pairs))] for q in Q[::-1]]
    assert forth == back[::-1]


def test_near_equals_contacts_one_by_one(model: CollisionModel, panda: Robot) -> None:
    Q = random_q(panda, 8, seed=6)
    batch = model.near(Q, 0.1)
    one_by_one = [(row, c) for row, q in enumerate(Q) for c in model.contacts(q, 0.1)]
    assert [(row, c.pair.index) for row, c in one_by_one] == list(
        zip(batch.rows.tolist(), batch.pairs.tolist(), strict=True)
    )
    np.testing.assert_allclose(batch.distance, [c.distance for _, c in one_by_one], atol=1e-12)
    np.testing.assert_allclose(batch.normals, [c.normal for _, c in one_by_one], atol=1e-12)
    np.testing.assert_allclose(batch.points, [[c.point_a, c.point_b] for _, c in one_by_one], atol=1e-12)


def test_a_scene_without_pairs(panda: Robot) -> None:
    names = {frozenset((p.name_a, p.name_b)) for p in CollisionModel(panda, Scene()).pairs}
    free = CollisionModel(panda, Scene(allowed=frozenset(names)))
    assert free.pairs == ()
    assert free.clearance(np.zeros(panda.n)) is None
    assert not free.collides(np.zeros(panda.n))
    assert len(free.near(np.zeros((1, panda.n)), 1.0).rows) == 0


def test_hull_of_flat_points_is_refused() -> None:
    with pytest.raises(ValueError, match="one plane"):
        convex_hull(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]))


def test_mesh_that_cannot_be_read_is_refused(tmp_path: Path) -> None:
    (tmp_path / "broken.stl").write_text("not a mesh")
    with pytest.raises(ValueError, match=r"cannot read mesh .*broken\.stl"):
        build_geometry(Mesh(tmp_path / "broken.stl"))


def test_a_mesh_with_nan_is_refused(tmp_path: Path) -> None:
    corners = "".join(f"vertex {x} 0 {z}\n" for x, z in (("0", "0"), ("nan", "1"), ("1", "1")))
    facet = f"facet normal 0 1 0\nouter loop\n{corners}endloop\nendfacet\n"
    (tmp_path / "nan.stl").write_text(f"solid a\n{facet}endsolid a\n")
    with pytest.raises(ValueError, match="not a finite number"):
        build_geometry(Mesh(tmp_path / "nan.stl"))


@pytest.mark.parametrize("tilt", [0.0, 0.7])
def test_a_mesh_that_lies_in_a_plane_is_touched(panda: Robot, tmp_path: Path, tilt: float) -> None:
    """A sheet through the hand; the broad phase alone overlooks it."""
    file = tmp_path / "sheet.obj"
    file.write_text("v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nf 1 2 3\nf 1 3 4\n")
    turned = pin.SE3(pin.utils.rotate("x", tilt), np.zeros(3))
    attached = Attachment("held", Box((0.1, 0.1, 0.1)), "panda_hand", pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.2])))
    q, data = np.array(panda.configurations["ready"]), panda.model.createData()
    pin.framesForwardKinematics(panda.model, data, q)
    hand = data.oMf[panda.model.getFrameId("panda_hand")] * attached.X_LO
    through = pin.SE3(turned.rotation, hand.translation)
    for place, touches in ((through, True), (pin.SE3(turned.rotation, np.array([9.0, 0.0, 0.5])), False)):
        model = CollisionModel(panda, Scene((Obstacle("sheet", Mesh(file), place),), (attached,)))
        margins = PairMargins(model)
        margins.set(np.zeros(len(model.pairs)))
        assert (model.collides(q), margins.near(q)) == (touches, touches)
