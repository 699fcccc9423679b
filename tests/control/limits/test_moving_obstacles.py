"""Obstacles that move, in the rows of the controller and in the stops that it looks at."""

import math

import numpy as np
import pytest

import optiplan as op
from benchmarks.demonstrations import controller_moving_obstacle as moving
from optiplan._core import core
from optiplan.collision.model import CollisionModel
from optiplan.control.braking_path import make_braking_path
from optiplan.control.limits import stop_limits
from optiplan.control.limits.moving_obstacles import ObstacleJoints, PathAmongMoving
from optiplan.control.limits.stop_limits import Abilities, StopLimit


def ball(position, polynomial, until=None):
    return op.Sphere("ball", radius=0.05, position=position).moving(polynomial, until=until)


@pytest.fixture
def bound(panda):
    """A limit beside a ball that comes, a controller that has bound it, and where the ball is near."""
    limit = op.ClearanceLimit(op.Scene([ball((0.75, 0.0, 0.6), [[0, -0.5], [0], [0, 0.1, -0.2]], 0.6)]))
    controller = op.Controller(panda, [], limits=[*op.Controller(panda, []).limits, limit])
    return limit, controller


@pytest.mark.parametrize("form", ["velocity", "acceleration"])
@pytest.mark.parametrize("name", list(moving.BALLS))
def test_the_arm_gets_out_of_the_way(monkeypatch, form, name):
    monkeypatch.setattr(moving, "DT", 0.005)
    found = moving.evade(*moving.BALLS[name], form)
    assert found["least"] > 0.0
    assert found["far"] > 0.1, "it had to"


def test_the_arm_gets_out_of_the_way_without_the_core_as_well(panda):
    """A second of it, which is slow."""
    scene = op.Scene([ball((0.3, 0.45, 0.6), [[0], [0, -0.5], [0]])])
    limit = op.ClearanceLimit(scene)
    given = [*op.Controller(panda, []).limits, limit]
    controller = op.Controller(panda, [op.PostureTask("ready", cost=1.0)], limits=given)
    limit._watch = None
    state, check, statuses = op.State(panda.configurations["ready"]), CollisionModel(panda, scene), set()
    for _ in range(100):
        step = controller.step(state, 0.01)
        state = step.state
        statuses.add(step.status)
        assert check.clearance(check.at_times(state.q[None], np.array([controller.time]))[0]).distance > 0.0
    assert statuses - {"tracking"}, "it had to"


def test_the_live_loop_of_a_falling_ball_runs():
    assert moving.live_falling_ball()["least"] >= 0.005


@pytest.mark.skipif(core is None, reason="the native core was not built")
def test_views_rows_and_stops_agree(monkeypatch, panda, bound):
    limit, controller = bound
    rng, c = np.random.default_rng(0), controller.configuration
    robot, path, verdicts = panda.configurations["ready"], make_braking_path(panda), []
    limits = panda.limits
    abilities = Abilities(np.full(7, 0.004), 1.0 / limits.acceleration)
    for t in np.linspace(0.0, 0.7, 30):
        q, v = robot + rng.normal(0.0, 0.1, 7), rng.normal(0.0, 0.5, 7)
        here = c(op.State(q))
        native = limit.view(here, None, t)
        watch, limit._watch = limit._watch, None
        python = limit.view(here, None, t)
        np.testing.assert_array_equal(native.near, python.near)
        np.testing.assert_allclose(native.distance, python.distance, atol=1e-8)
        np.testing.assert_allclose(native.gradient, python.gradient, atol=1e-5)
        np.testing.assert_allclose(limit.drift(native, t), limit.drift(python, t), atol=1e-5)
        rows = limit.rows(native, v, abilities, 0.002, t)
        with monkeypatch.context() as patch:
            patch.setattr(stop_limits, "core", None)
            slow = limit.rows(native, v, abilities, 0.002, t)
        np.testing.assert_allclose(rows.G, slow.G, atol=1e-12)
        np.testing.assert_allclose(rows.low, slow.low, atol=1e-9)
        path.start(q, v, np.zeros(7), controller._box, 0.002)
        least = np.minimum(native.bound - 1e-6, rng.uniform(0.0, 0.1))
        limit._watch = watch
        among = PathAmongMoving(path, limit._obstacles, t, limit._placed)
        verdict = StopLimit.stop_is_clear(limit, among, python, least, t)
        verdicts.append(limit.stop_is_clear(path, native, least, t))
        assert path.way.shape == path.end.shape == (7,)  # as before, for the limits that follow
        assert verdict == verdicts[-1]
    assert 3 < sum(verdicts) < 27, "both answers are worth comparing"


def test_limits_of_two_scenes_stand_beside_each_other(panda):
    cart = op.Box("cart", size=(0.1, 0.1, 0.1), position=(0.75, 0.0, 0.5)).moving([[0.0, -0.05], [0.0], [0.0]])
    post = op.Box("post", size=(0.1, 0.1, 0.1), position=(0.55, 0.3, 0.5))
    both = [op.ClearanceLimit(op.Scene([body]), at_least=0.02) for body in (cart, post)]
    controller = op.Controller(panda, [op.PostureTask("ready")], limits=[*op.Controller(panda, []).limits, *both])
    state = op.State(panda.configurations["ready"], v=[0.4, 0.6, 0.0, 0.3, 0.0, 0.2, 0.0])
    for _ in range(30):
        step = controller.step(state, 0.002)
        state = step.state
        assert step.status == "tracking"


def test_what_lies_ahead_of_a_stop_is_where_obstacles_were_seen_last(panda):
    limit = op.ClearanceLimit(op.Scene([op.Sphere("ball", radius=0.05, position=(2.0, 0.0, 0.5))]))
    controller = op.Controller(panda, [], limits=[*op.Controller(panda, []).limits, limit])
    ready = panda.configurations["ready"]
    tip = panda.fk(ready).matrix[:3, 3]
    controller.step(op.State(ready), 0.002)
    for place in ((2.0, 0.0, 0.5), tip):
        controller.update_scene({"ball": op.Pose(tuple(place))})
    path = make_braking_path(panda)
    path.start(ready, np.zeros(7), np.zeros(7), controller._box, 0.002)
    assert limit.ahead(path, 0.0).max() < 0.0


def test_a_distance_shrinks_as_its_drift_says(panda, bound):
    limit, controller = bound
    here = controller.configuration(op.State(panda.configurations["ready"]))
    for t in (0.1, 0.4, 0.8):
        view, later = (limit.view(here, None, s) for s in (t, t + 1e-5))
        np.testing.assert_allclose((later.distance - view.distance) / 1e-5, limit.drift(view, t), atol=1e-3)
    assert (limit.drift(limit.view(here, None, 0.1), 0.1) < -0.1).any()


def test_how_far_and_how_unsteadily_obstacles_move_at_most(panda, bound):
    limit, controller = bound
    joints, path = limit._obstacles, make_braking_path(panda)
    path.start(panda.configurations["ready"], np.full(7, 0.3), np.zeros(7), controller._box, 0.002)
    for t in (0.0, 0.5, 0.59):
        among = PathAmongMoving(path, joints, t, limit._placed)
        assert among.steps * among.dt >= 0.4
        found = np.array([among.at(k) for k in range(among.steps + 1)])
        assert (among.way >= np.abs(found - found[0]).max(axis=0) - 1e-9).all()
        first, last = 10, among.steps - 10
        straight = found[first] + np.linspace(0, 1, last - first + 1)[:, None] * (found[last] - found[first])
        strays = np.abs(found[first : last + 1] - straight).max(axis=0)
        time = (last - first) * among.dt
        assert (strays <= time * time / 8.0 * among.strongest(first, last) + 1e-9).all()


def test_obstacle_joints_are_polynomials_until_they_stand():
    obstacle = ball((0, 0, 0), [[0, 1.0], [0], [0, 0, -2.0]], 0.5)
    joints = ObstacleJoints([obstacle.motion])
    C, left = joints.coefficients(0.2)
    assert left.tolist() == pytest.approx([0.3] * 3)
    for s in (0.0, 0.1, 0.3):
        np.testing.assert_allclose(C @ s ** np.arange(C.shape[1]), joints.at(0.2 + s), atol=1e-12)
    assert not joints.rates(0.6).any()
    assert math.isclose(joints.at(9.0)[0], 0.5)


def test_the_controller_keeps_the_time(panda):
    controller = op.Controller(panda, [], scene=op.Scene([ball((1.5, 0, 0.5), [[0, -1.0], [0], [0]])]))
    state = op.State(panda.configurations["ready"])
    for dt in (0.01, 0.02):
        state = controller.step(state, dt).state
    controller.stop(state, 0.03)
    assert controller.time == pytest.approx(0.06)
    controller.time = 0.55  # where another clock runs
    step = controller.step(state, 0.001)
    check = CollisionModel(panda, controller.limits[-1].scene)
    nearest = check.clearance(check.at_times(step.q[None], np.array([0.551]))[0])
    assert step.nearest.distance == pytest.approx(nearest.distance, abs=1e-6)
