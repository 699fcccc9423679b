"""The sweep against constructed grazes and against dense sampling."""

import itertools

import numpy as np
import pytest

from optiplan._core import core
from optiplan.collision.model import CollisionModel
from optiplan.collision.native_model import NativeCollisionModel
from optiplan.geometry.scene import Obstacle, Scene, Sphere
from optiplan.planners.common import continuous_collision
from optiplan.planners.common.continuous_collision import contacts_along, first_contact, motion_about
from optiplan.trajectory.timing.stops import stop_at_corners
from tests.planners import cases
from tests.planners.polyline import polyline_contact


def swing(n=1):
    arm = cases.robot("planar2r")
    return arm, stop_at_corners(np.array([[0.0, 0.0], [-1.5, 0.0]]), arm.limits, arm.joint_names)


def ball_beside_the_tip(gap):
    """A ball of 2 mm in the plane of the tip, `gap` away from the circle that the tip's ball sweeps, half-way."""
    arm, trajectory = swing()
    return CollisionModel(arm, Scene((ball_at("ball", -0.75, gap),))), trajectory


def ball_at(name, angle, gap, radius=0.002):
    """A ball that lies `gap` beyond the tip's ball where the shoulder is at an angle."""
    import pinocchio as pin

    arm = cases.robot("planar2r")
    model, data = arm.model, arm.model.createData()
    q = np.array([angle, 0.0])
    pin.framesForwardKinematics(model, data, q)
    tip, tool = (data.oMf[model.getFrameId(name)] for name in ("tip", "tool"))
    outward = tool.rotation[:, 0]
    centre = tip.translation + (0.06 + 0.04 + radius + gap) * outward
    pose = pin.SE3(np.eye(3), centre)
    return Obstacle(name, Sphere(radius), pose)


def test_a_graze_shorter_than_any_sampling_step_is_found():
    model, trajectory = ball_beside_the_tip(-50e-6)
    coarse = trajectory(np.linspace(0.0, trajectory.duration, 100))  # an even number misses the middle
    assert not any(model.collides(q) for q in coarse)
    touch = first_contact(model, trajectory)
    assert touch is not None
    assert {touch.contact.pair.name_a, touch.contact.pair.name_b} == {"tip", "ball"}
    assert touch.q == pytest.approx(trajectory(np.array([touch.t]))[0])
    assert polyline_contact(model, np.stack([trajectory.start, trajectory.end])) is not None


def test_a_gap_of_the_same_size_is_proved_free():
    model, trajectory = ball_beside_the_tip(50e-6)
    assert first_contact(model, trajectory) is None
    assert polyline_contact(model, np.stack([trajectory.start, trajectory.end])) is None


def test_every_stretch_of_touching_gives_one_touch():
    """Three balls on the way, each met for longer than a sample; the first touch is `first_contact`."""
    arm, trajectory = swing()
    balls = tuple(ball_at(f"ball{k}", angle, -0.03, radius=0.05) for k, angle in enumerate([-0.35, -0.75, -1.15]))
    model = CollisionModel(arm, Scene(balls))
    touches = list(contacts_along(model, trajectory))
    names = [{touch.contact.pair.name_a, touch.contact.pair.name_b} for touch in touches]
    assert [name & {"ball0", "ball1", "ball2"} for name in names] == [{"ball0"}, {"ball1"}, {"ball2"}]
    assert [touch.t for touch in touches] == sorted(touch.t for touch in touches)
    touching = [model.collides(q) for q in trajectory(np.linspace(0.0, trajectory.duration, 2000))]
    assert sum(np.diff(np.array(touching, dtype=int)) == 1) == len(touches)
    first = first_contact(model, trajectory)
    assert (first.t, first.contact.pair) == (touches[0].t, touches[0].contact.pair)
    for touch in touches:
        assert model.collides(touch.q)
        assert touch.q == pytest.approx(trajectory(np.array([touch.t]))[0])


def test_a_graze_between_the_samples_is_one_touch_and_free_curves_give_none():
    model, trajectory = ball_beside_the_tip(-50e-6)
    assert len(list(contacts_along(model, trajectory))) == 1
    model, trajectory = ball_beside_the_tip(50e-6)
    assert list(contacts_along(model, trajectory)) == []


@pytest.mark.parametrize("allowed", [0, 1, 20])
def test_what_is_not_proved_when_it_is_stopped_is_a_touch(allowed):
    """However many times it may go on: before the first query, among the queries, and in the proof."""
    model, trajectory = ball_beside_the_tip(50e-6)
    left = iter([False] * allowed)
    touch = first_contact(model, trajectory, lambda: next(left, True))
    assert touch is not None
    assert touch.q == pytest.approx(trajectory(np.array([touch.t]))[0])
    assert next(left, None) is None, "it stops when it is told to"


def test_it_is_polled_after_each_interval_that_takes_long(monkeypatch):
    """256 intervals were proved in one go: among meshes a budget of 4 s took 47 s."""
    arm, trajectory = swing()
    model = NativeCollisionModel(arm, Scene((ball_at("ball", -0.75, 50e-6),)))

    def polls(tick):
        asked, times = [], itertools.count(0.0, tick)
        monkeypatch.setattr(continuous_collision, "clock", lambda: next(times))
        assert first_contact(model, trajectory, lambda: asked.append(True)) is None
        return len(asked)

    quick, slow = polls(1e-6), polls(1.0)
    assert quick < 0.5 * slow
    assert slow > 2 * 1.5 / continuous_collision._FIRST_STEP  # of both passes


def test_agrees_with_dense_sampling():
    rng = np.random.default_rng(3)
    model = CollisionModel(cases.robot("panda"), cases.wall().scene)
    limits = model.robot.limits
    free = touching = 0
    for _ in range(25):
        ends = rng.uniform(limits.lower, limits.upper, (2, 7))
        ends[1] = ends[0] + 0.3 * (ends[1] - ends[0])
        trajectory = stop_at_corners(ends, limits, model.robot.joint_names)
        seen = any(model.collides(q) for q in trajectory(np.linspace(0.0, trajectory.duration, 400)))
        found = [first_contact(model, trajectory), polyline_contact(model, ends)]
        assert not seen or all(touch is not None for touch in found)
        assert (found[0] is None) == (found[1] is None)
        free += found[0] is None
        touching += seen
    assert free > 3
    assert touching > 3


@pytest.mark.skipif(core is None, reason="the native core is not built")
def test_the_core_finds_the_touches_that_coal_finds():
    """It leaves out what is far all along some intervals, and stops at the first touch for who wants no more."""
    robot, scene = cases.robot("panda"), cases.wall().scene
    reference, native = CollisionModel(robot, scene), NativeCollisionModel(robot, scene)
    rng = np.random.default_rng(4)
    limits = robot.limits
    stretches = []
    for _ in range(30):
        ends = rng.uniform(limits.lower, limits.upper, (3, 7))
        ends[1:] = ends[0] + 0.4 * (ends[1:] - ends[0])
        curve = stop_at_corners(ends, limits, robot.joint_names)
        expected, found = (list(contacts_along(model, curve)) for model in (reference, native))
        first = first_contact(native, curve)
        assert [touch.t for touch in found] == pytest.approx([touch.t for touch in expected], abs=1e-9)
        assert (first.t if first else None) == (found[0].t if found else None)
        stretches.append(len(found))
    assert 0 in stretches
    assert max(stretches) > 1


def test_curve_bounds_hold_within_each_interval():
    _, trajectory = swing()
    rng = np.random.default_rng(0)
    half = rng.uniform(0.0, 0.4, 20) * np.diff(trajectory.breakpoints).min()
    piece = rng.integers(0, len(trajectory.breakpoints) - 1, 20)
    middle = 0.5 * (trajectory.breakpoints[piece] + trajectory.breakpoints[piece + 1])
    Q, D = motion_about(trajectory, middle, half)
    for offset in (-1.0, -0.3, 0.0, 0.5, 1.0):
        assert (np.abs(trajectory(middle + offset * half) - Q) <= D + 1e-12).all()
