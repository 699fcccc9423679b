"""Closed boxes: every configuration in them is in collision, or too far from both ends."""

import numpy as np
import pinocchio as pin
import pytest

import optiplan as op
from optiplan._core import core
from optiplan.collision.model import CollisionModel
from optiplan.robot.native_tree import native_tree
from optiplan.verify.bounds.bound import _passage
from optiplan.verify.bounds.closing import CLOSED, Closing
from optiplan.verify.bounds.inner_shapes import boxes_inside, rods_inside

pytestmark = pytest.mark.skipif(core is None, reason="needs the native core")


def passed_in_time(corridor, q):
    """Whether all joints can be at q in one step of the time."""
    return bool(((corridor.low <= q[:, None]) & (q[:, None] <= corridor.high)).all(axis=0).any())


@pytest.mark.parametrize("name", ["12_planar", "15_srra", "17_puma560", "22_via_spline"])
def test_closed_boxes_hold_no_free_configuration_that_is_passed_in_time(name):
    problem = op.load_problem(name)
    model = CollisionModel(problem.robot, problem.scene)
    passage = _passage(problem, problem.goal[0])
    closing = Closing.of(model, passage)
    rng = np.random.default_rng(1)
    T = 1.3 * passage.direct.max()
    corridor = passage.corridor(T)
    low, high = corridor.box()
    n = len(low)
    centre = rng.uniform(low, high, (1500, n))
    half = rng.uniform(0.0, 0.15, (1500, n)) * (high - low)
    boxes = np.maximum(centre - half, low), np.minimum(centre + half, high)
    closed = closing.close(corridor, *boxes, 64) == CLOSED
    assert 15 < closed.sum() < 1500
    for a, b in zip(boxes[0][closed], boxes[1][closed], strict=True):
        for q in [*rng.uniform(a, b, (6, n)), *np.where(rng.random((4, n)) < 0.5, a, b)]:
            assert model.collides(q) or not passed_in_time(corridor, q)


@pytest.mark.parametrize("name", ["05_cage", "09_ur5", "12_planar", "18_baxter_dual"])
def test_rods_lie_inside_bodies_and_boxes_inside_obstacles(name):
    problem = op.load_problem(name)
    model = CollisionModel(problem.robot, problem.scene)
    rods, boxes = rods_inside(model), boxes_inside(model)
    assert len(rods.joint)
    assert len(boxes.body)
    for ends, radius, body in zip(rods.ends, rods.radius, rods.body, strict=True):
        geometry = model.geometry.geometryObjects[int(body)]
        own = (ends - geometry.placement.translation) @ geometry.placement.rotation
        shape = geometry.geometry
        if hasattr(shape, "points"):
            points = np.array(shape.points())
            for direction in np.random.default_rng(0).normal(size=(50, 3)):
                direction /= np.linalg.norm(direction)
                assert (own @ direction).max() + radius <= (points @ direction).max() + 1e-9


def test_rods_lie_below_the_faces_of_long_thin_boxes():
    half = np.array([0.5, 0.01, 0.004])
    bar = op.Box("bar", size=2.0 * half).attached_to("forearm")
    model = CollisionModel(op.load_robot("two_links"), op.Scene(attached=[bar]))
    rods, body = rods_inside(model), model.names.index("bar")
    placement = model.geometry.geometryObjects[body].placement
    own = (rods.ends[rods.body == body] - placement.translation) @ placement.rotation
    assert len(own) > 4
    assert (np.abs(own) + rods.radius[rods.body == body, None, None] <= half).all()


def test_bodies_smaller_than_what_rounding_takes_have_no_rods():
    dot = op.Sphere("dot", radius=5e-6).attached_to("forearm")
    rods = rods_inside(CollisionModel(op.load_robot("two_links"), op.Scene(attached=[dot])))
    assert len(rods.radius)
    assert rods.radius.min() > 0.0


def test_robots_of_many_joints_have_closed_boxes():
    """A rod behind seventy joints, as of eight arms with hands, of which the first leads it into a box."""
    model = pin.Model()
    for k in range(70):
        model.addJoint(k, pin.JointModelRZ(), pin.SE3.Identity(), f"joint {k}")
    zeros, ones = np.zeros(1, dtype=np.int64), np.ones(1, dtype=np.int64)
    closing = core.BoxClosing(
        native_tree(model),
        np.array([[0.5, 0.0, 0.0], [1.0, 0.0, 0.0]]),
        np.array([0.05]),
        70 * ones,
        zeros,
        np.array([[0, 0]], dtype=np.int64),
        np.eye(3)[None],
        np.array([[0.8, 0.0, 0.0, 0.2, 0.2, 0.2, 0.0]]),
        zeros,
        np.full((2, 70), 1.0),
    )
    wide, near, far = np.full((70, 1), 9.0), np.zeros((1, 70)), np.zeros((1, 70))
    near[0, 0], far[0, 0] = 0.01, 1.5
    assert closing.close(-wide, wide, near, near, 4) == CLOSED
    assert closing.close(-wide, wide, far, far, 4) != CLOSED
