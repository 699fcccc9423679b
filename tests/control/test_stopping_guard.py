"""What the guard takes for granted."""

import numpy as np
import pytest

import optiplan as op
from optiplan._core import core
from optiplan.control.braking_path import BrakingPath, make_braking_path
from optiplan.control.limits.stop_limits import StopLimit


@pytest.mark.parametrize("acceleration", [[op.AccelerationLimit()], []], ids=["with", "without"])
def test_the_simple_bound_of_a_stop_is_one(panda, baxter, delbot, acceleration):
    rng, others = np.random.default_rng(0), [op.PositionLimit(), op.VelocityLimit(), op.JerkLimit()]
    for robot in (panda, baxter, delbot):
        for dt in (0.001, 0.01):
            controller = op.Controller(robot, [], limits=[*others, *acceleration, op.ClearanceLimit()])
            start = op.State(next(iter(robot.configurations.values())))
            controller.step(start, dt)
            guard, box, path = controller._guard, controller._box, BrakingPath(robot)
            for _ in range(80):  # of 7 to 14 joints each
                v = rng.uniform(-1, 1, robot.n) * robot.limits.velocity * rng.choice([1.0, 0.05])
                a = rng.uniform(-1, 1, robot.n) * robot.limits.acceleration
                path.start(start.q, v, a, box, dt)
                way = np.max([np.abs(path.at(k) - start.q) for k in range(0, path.steps + 1, 5)], axis=0)
                assert (guard._longest_way(op.State.of(start.q, v, a)) >= way).all()
                assert path.at(path.steps) == pytest.approx(path.end, abs=1e-10)


def stops_beside(robot, box, rng, count):
    """Stops that begin at random velocities and accelerations, half of them slow: these turn back on their way."""
    start = next(iter(robot.configurations.values()))
    for k in range(count):
        q = np.clip(start + rng.normal(0.0, 0.3, robot.n), robot.limits.lower, robot.limits.upper)
        v = rng.uniform(-1, 1, robot.n) * robot.limits.velocity * (0.03, 0.3)[k % 2]
        yield q, v, rng.uniform(-1, 1, robot.n) * robot.limits.acceleration


@pytest.mark.parametrize("name", ["panda", "delbot"])
def test_a_stop_is_clear_if_every_step_of_it_is(request, delbot, name):
    """The verdict, natively and in Python, is that of measuring all distances in all steps.

    Nothing is missed, nothing refused in vain.
    """
    robot = request.getfixturevalue(name)
    scene = op.Scene([op.Box("post", size=(0.1, 0.1, 0.8), position=(0.45, 0.3, 0.4))])
    limit = op.ClearanceLimit(scene)
    controller = op.Controller(robot, [], limits=[*op.Controller(robot, []).limits, limit])
    controller.step(op.State(next(iter(robot.configurations.values()))), 0.002)
    rng, box, c = np.random.default_rng(3), controller._box, controller.configuration
    path, verdicts, dips = make_braking_path(robot), [], 0
    everything = np.arange(len(limit.labels))
    for q, v, a in stops_beside(robot, box, rng, 14 if robot is delbot else 28):
        path.start(q, v, a, box, 0.002)
        found = np.array([limit.distances(c(op.State(path.at(k))), everything) for k in range(path.steps + 1)])
        ends = np.minimum(found[0], found[-1]) - 1e-7
        least = np.minimum(ends, found.min(axis=0) + rng.choice([-1e-6, 1e-6, 1e-3]))
        dips += bool((found.min(axis=0) < ends - 1e-4).any())
        verdicts.append(bool((found >= least).all()))
        here = c(op.State(q))
        for way in {StopLimit} if core is None else {StopLimit, type(limit)}:
            assert way.stop_is_clear(limit, path, way.view(limit, here, None, 0.0), least, 0.0) == verdicts[-1], way
    assert 0.2 * len(verdicts) < sum(verdicts) < 0.8 * len(verdicts)
    assert dips > 0.2 * len(verdicts), "distances are often least in the middle"


def test_how_far_joints_get_and_how_hard_they_brake(panda):
    rng, dt = np.random.default_rng(1), 0.002
    controller = op.Controller(panda, [])
    controller.step(op.State(panda.configurations["ready"]), dt)
    path = make_braking_path(panda)
    for q, v, a in stops_beside(panda, controller._box, rng, 60):
        path.start(q, v, a, controller._box, dt)
        Q, V = path.motion(np.arange(path.steps + 1))
        assert (path.way >= np.abs(Q - q).max(axis=0) - 1e-12).all()
        assert (path.way <= np.abs(Q - q).max(axis=0) + dt * np.abs(V).max(axis=0) + 1e-9).all()
        first, last = sorted(rng.integers(0, path.steps + 1, 2).tolist())
        if first < last:
            hardest = (np.abs(np.diff(V[first : last + 1], axis=0)) / dt).max(axis=0)
            assert (path.strongest(first, last) >= hardest - 1e-9).all()
            assert (path.strongest(first, last) <= hardest + 0.5 * dt * panda.limits.jerk + 1e-9).all()
