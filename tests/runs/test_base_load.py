"""The load on the base: the weight at rest, with a payload, wherever the base stands."""

import numpy as np
import pytest

import optiplan as op
from optiplan.runs.base_load import base_load
from optiplan.trajectory.trajectory import Trajectory


def at_rest(robot, q):
    return Trajectory(robot.joint_names, np.array([0.0, 1.0]), np.array(q)[None, None])


def test_at_rest_it_is_the_weight_at_the_centre_of_mass():
    robot = op.load_robot("ur5")
    mass = sum(body.mass for body in robot.model.inertias)
    load = base_load([(robot, at_rest(robot, np.zeros(6)))])
    assert load.force == pytest.approx(9.81 * mass)
    (x, X), (y, Y) = load.zero_moment_point
    assert (x, y) == pytest.approx((X, Y))
    assert load.moment == pytest.approx(9.81 * mass * np.hypot(x, y))


def test_a_run_has_it_and_it_moves_with_the_base():
    problem = op.Problem("ur5", [0.0, -1.5, 1.5, 0, 0, 0], [1.0, -1.0, 1.0, 0, 0, 0], planner="quintic")
    moved = op.load_problem({**problem.source, "base": {"position": [3, 0, 1]}})
    one, two = (op.plan(each, budget=3.0).metrics.base_load for each in (problem, moved))
    assert two.force == pytest.approx(one.force)
    assert two.moment == pytest.approx(one.moment)
    assert np.allclose(np.array(two.zero_moment_point) - one.zero_moment_point, [[3.0, 3.0], [0.0, 0.0]])
    assert base_load([]) is None


def test_a_robot_without_masses_has_none():
    robot = op.load_robot("baxter_report")
    assert base_load([(robot, at_rest(robot, np.zeros(7)))]) is None
