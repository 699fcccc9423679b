"""The fastest profiles between states: continuous, within limits, exact at their ends, and never beaten."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import linprog

import optiplan as op
from optiplan.trajectory.profiles.state_to_state import BetweenStates, fastest, fastest_run_up, fastest_stop
from optiplan.trajectory.state import State
from optiplan.trajectory.timing.lower_bound import lower_bounds, moving_bounds

PROBLEM = op.load_problem("01_reach")
LIMITS, NAMES, N = PROBLEM.limits, PROBLEM.robot.joint_names, PROBLEM.robot.n


def states(rng, share=0.6):
    q, v, a = rng.uniform(-1.0, 1.0, N), share * rng.uniform(-1.0, 1.0, N), share * rng.uniform(-1.0, 1.0, N)
    return State(q, v * LIMITS.velocity, a * LIMITS.acceleration)


def check(motion, start, end):
    for order, (here, there) in enumerate(zip((start.q, start.v, start.a), (end.q, end.v, end.a), strict=True)):
        assert motion(0.0, order) == pytest.approx(here, abs=1e-9)
        assert motion(motion.duration, order) == pytest.approx(there, abs=1e-7)
        assert np.abs(motion.jumps(order)).max(initial=0.0) < 1e-9
    for order in (1, 2, 3):
        assert (np.abs(motion.extrema(order)) <= LIMITS.rates[order - 1] * (1.0 + 1e-7)).all()


def test_between_states():
    rng = np.random.default_rng(0)
    for _ in range(20):
        start, end = states(rng), states(rng)
        motion = fastest(start, end, LIMITS, NAMES)
        check(motion, start, end)
        assert motion.duration >= moving_bounds(start, [end], LIMITS)[0] * (1.0 - 1e-9)
        slower = BetweenStates(start, end, LIMITS, NAMES).trajectory(3.0 * motion.duration)
        check(slower, start, end)


def test_stops_and_run_ups():
    rng = np.random.default_rng(1)
    for _ in range(20):
        state = states(rng)
        stop, run_up = fastest_stop(state, LIMITS, NAMES), fastest_run_up(state, LIMITS, NAMES)
        check(stop, state, State(stop.end))
        check(run_up, State(run_up.start), state)
    assert fastest_stop(State(state.q), LIMITS, NAMES) is None


def test_bounds_of_rest_are_those_of_the_s_curve():
    rng = np.random.default_rng(2)
    start, ends = rng.uniform(-1, 1, N), rng.uniform(-1, 1, (5, N))
    found = moving_bounds(State(start), [State(q) for q in ends], LIMITS)
    assert found == pytest.approx(lower_bounds(start, ends, LIMITS), rel=1e-12)


def feasible(start, end, T, limits, steps=160):
    """Whether piecewise linear accelerations on a grid lead one joint from state to state in the time T."""
    h = T / steps
    v, a, j = (float(limit[0]) for limit in limits.rates)
    # q and v at the knots are linear in the accelerations at the knots
    to_v = h * (np.tril(np.ones((steps + 1, steps + 1))) - 0.5 * np.eye(steps + 1))
    to_v[:, 0] -= 0.5 * h
    to_v[0] = 0.0
    last = to_v[-1]
    to_q = np.zeros(steps + 1)
    for k in range(steps):
        to_q += h * to_v[k]
        to_q[k] += h * h / 3.0
        to_q[k + 1] += h * h / 6.0
    first, final = np.eye(steps + 1)[[0, -1]]
    equal = np.array([first, final, last, to_q])
    right = np.array([start.a[0], end.a[0], end.v[0] - start.v[0], end.q[0] - start.q[0] - T * start.v[0]])
    change = np.diff(np.eye(steps + 1), axis=0) / h
    rows = np.vstack([change, -change, to_v, -to_v])
    most = np.concatenate(
        [np.full(2 * steps, j), np.full(steps + 1, v - start.v[0]), np.full(steps + 1, v + start.v[0])]
    )
    return linprog(np.zeros(steps + 1), rows, most, equal, right, bounds=(-a, a)).status == 0


def test_no_motion_beats_the_bound():
    """A discretised motion of one joint is a motion: where one exists, the bound is below it, and hardly so."""
    rng = np.random.default_rng(3)
    one = LIMITS.of_joints([0])
    for _ in range(8):
        start, end = (State(s.q[:1], s.v[:1], s.a[:1]) for s in (states(rng, 0.8), states(rng, 0.8)))
        bound = float(moving_bounds(start, [end], one)[0])
        assert not feasible(start, end, 0.97 * bound, one), "a motion is faster than the bound"
        found = next(f for f in (1.02, 1.05, 1.1, 1.3, 1.6, 2.0) if feasible(start, end, f * bound, one))
        assert found <= 1.1


def test_without_jerk_limits_the_bound_is_that_of_accelerations():
    free = replace(LIMITS, jerk=np.full(N, np.inf))
    rng = np.random.default_rng(4)
    for _ in range(5):
        start, end = states(rng), states(rng)
        assert moving_bounds(start, [end], free)[0] <= moving_bounds(start, [end], LIMITS)[0] * (1.0 + 1e-9)
