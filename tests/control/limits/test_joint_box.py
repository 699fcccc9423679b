"""The native joint box beside the one in Python, for every choice of limits."""

from itertools import combinations

import numpy as np
import pytest

import optiplan as op
from optiplan._core import core
from optiplan.control.limits.joint_box import JointBox
from optiplan.control.limits.joint_limits import JointLimit, PositionLimit

DT = 0.002
ORDER = ("jerk", "acceleration", "velocity", "position")
KINDS = {
    "position": op.PositionLimit,
    "velocity": op.VelocityLimit,
    "acceleration": op.AccelerationLimit,
    "jerk": op.JerkLimit,
}
CHOICES = [names for count in range(5) for names in combinations(KINDS, count)]


def boxes(robot, names, by_acceleration):
    limits = [KINDS[name]() for name in names]
    for limit in limits:
        assert isinstance(limit, JointLimit | PositionLimit)
        limit.bind(robot)
    made = [JointBox(limits, ORDER, robot.n, by_acceleration, 0.01) for _ in range(2)]
    made[1]._table = None
    return made


@pytest.mark.skipif(core is None, reason="the native core was not built")
@pytest.mark.parametrize("by_acceleration", [False, True])
@pytest.mark.parametrize("names", CHOICES, ids=" ".join)
def test_both_twins_give_the_same_bounds_and_brakes(names, by_acceleration):
    robot = op.load_robot("panda")
    native, python = boxes(robot, names, by_acceleration)
    limits, rng = robot.limits, np.random.default_rng(0)
    for k in range(40):
        near = rng.uniform(0.0, 0.02, robot.n)
        q = np.where(rng.random(robot.n) < 0.5, limits.lower + near, limits.upper - near)
        q = q if k % 2 else rng.uniform(limits.lower, limits.upper)
        v, a = (rng.uniform(-1.1, 1.1, robot.n) * most for most in (limits.velocity, limits.acceleration))
        state = op.State(q, v, a)
        native.update(state, DT)
        python.update(state, DT)
        for one, other in ((native.low, python.low), (native.high, python.high), (native.slowing, python.slowing)):
            np.testing.assert_allclose(one, other, rtol=0.0, atol=1e-9)
        assert (python.low <= python.high).all()
        assert (python.low < np.inf).all()
        assert (python.high > -np.inf).all()
        brakes = native.brake(state, DT), python.brake(state, DT)
        for part in ("q", "v", "a"):
            np.testing.assert_allclose(*(getattr(brake, part) for brake in brakes), rtol=0.0, atol=1e-9)
        assert [name for name, *_ in native._intervals] == [name for name, *_ in python._intervals]


def test_the_brake_is_of_the_length_of_the_step(panda):
    """Also of a state whose bounds were found for a step of another length."""
    native, _ = boxes(panda, ["jerk", "acceleration"], False)
    state = op.State(np.zeros(7), 0.5 * np.ones(7))
    native.update(state, DT)
    first, second = native.brake(state, 5.0 * DT), native.brake(state, 5.0 * DT)
    np.testing.assert_array_equal(first.v, second.v)
    assert (first.v < native.brake(state, DT).v).all()
