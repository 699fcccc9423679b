"""Where joints can be at any time: beside profiles of Ruckig between the ends and a state on the way."""

import numpy as np
import pytest

from optiplan.robot.limits import Limits
from optiplan.trajectory.profiles.state_to_state import joint_times_between
from optiplan.trajectory.state import State
from optiplan.verify.bounds.times import STEPS, Passage

SPEED, ACCELERATION = 2.0, 5.0


@pytest.fixture(params=[(0.0, 1.5), (0.3, -0.1), (0.2, 0.2)], ids=["far", "near", "back"])
def passage(request):
    """The way of one joint, which has no limit of jerk that matters."""
    start, goal = (np.array([q]) for q in request.param)
    one = np.ones(1)
    limits = Limits(-9.0 * one, 9.0 * one, SPEED * one, ACCELERATION * one, 1e6 * one, np.inf * one)
    return Passage(start, goal, limits, 0.0 * one)


def least_times(passage, x, v):
    """The least times, s, from the start to (x, v), and from there to the goal, by Ruckig."""
    rest = np.zeros(1)
    here = State.of(np.array([x]), np.array([v]), rest)
    start, goal = (State.of(q, rest, rest) for q in (passage.start, passage.goal))
    return [
        np.inf if found is None else float(found[0])
        for found in (joint_times_between(start, here, passage.limits), joint_times_between(here, goal, passage.limits))
    ]


def test_a_state_on_the_way_lies_within_the_corridor_at_its_time(passage):
    rng = np.random.default_rng(2)
    T = float(passage.direct.max()) + 0.6
    corridor = passage.corridor(T)
    low, high = corridor.box()
    checked = 0
    for x, v in zip(rng.uniform(low[0] - 0.1, high[0] + 0.1, 300), rng.uniform(-SPEED, SPEED, 300), strict=True):
        came, goes = least_times(passage, x, v)
        for t in (came, T - goes):
            if came + goes < T:
                k = min(int(t / T * STEPS), STEPS - 1)
                assert corridor.low[0, k] <= x <= corridor.high[0, k]
                checked += 1
    assert checked > 40


def test_the_corridor_is_hardly_wider_than_what_can_be_reached(passage):
    T = float(passage.direct.max()) + 0.6
    corridor = passage.corridor(T)
    for k in (STEPS // 8, STEPS // 2, STEPS - 20):
        t, x = T * (k + 0.5) / STEPS, corridor.high[0, k] - 2.0 * SPEED * T / STEPS
        times = [least_times(passage, x, v) for v in np.linspace(-SPEED, SPEED, 81)]
        assert any(came <= t and goes <= T - t for came, goes in times)


def test_a_shorter_time_has_a_narrower_corridor(passage):
    T = float(passage.direct.max()) + 0.1
    short, long = passage.corridor(T), passage.corridor(2.0 * T)
    assert np.all(short.box()[0] >= long.box()[0])
    assert np.all(short.box()[1] <= long.box()[1])
    assert short.high.max() >= max(passage.start[0], passage.goal[0])
