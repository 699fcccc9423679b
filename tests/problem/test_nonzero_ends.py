"""States of motion at the start and at goals: in files, in Python, in the hash; those that no robot can be in."""

from dataclasses import replace

import numpy as np
import pytest

import optiplan as op
from optiplan.trajectory.timing.stopping import fastest_reached, furthest

REACH = op.load_problem("01_reach")
N = REACH.robot.n
LIMITS = REACH.limits


def one(j, value):
    return np.eye(N)[j] * value


def refusal(make):
    with pytest.raises(op.InputError) as caught:
        make()
    return str(caught.value)


def test_file_and_python_are_the_same_problem(tmp_path):
    v, a = one(0, 0.4) - one(3, 0.2), one(2, 1.5)
    moving = REACH.with_start(op.State(REACH.start, v, a)).with_goal(op.State(REACH.goal[0].q, one(1, 0.1)))
    assert moving.hash != REACH.hash
    assert moving.start_velocity == pytest.approx(v)
    assert moving.start_acceleration == pytest.approx(a)
    assert moving.end_states(REACH.goal[0].q)[0].v == pytest.approx(one(1, 0.1))
    moving.save(tmp_path / "moving.yaml")
    text = (tmp_path / "moving.yaml").read_text()
    assert "velocity: [0.4, 0.0, 0.0, -0.2" in text
    assert op.load_problem(tmp_path / "moving.yaml").hash == moving.hash
    goal = op.JointGoal(REACH.goal[0].q, velocity=one(1, 0.1))
    other = op.Problem("panda", REACH.start, goal, name="reach", start_velocity=v, start_acceleration=a)
    assert other.start_state.a == pytest.approx(a)
    assert {key: other.source[key] for key in ("start", "goal")} == {k: moving.source[k] for k in ("start", "goal")}


def test_rest_is_said_in_one_way():
    zeros = {"joints": REACH.start.tolist(), "velocity": [0.0] * N, "acceleration": [0.0] * N}
    still = op.Problem("panda", zeros, REACH.goal[0])
    assert still.hash == op.Problem("panda", REACH.start, REACH.goal[0]).hash
    assert not still.nonzero_ends
    assert still.source["start"].keys() == {"joints"}
    pose = {"pose": {"position": [0.5, 0, 0.4], "rpy": [np.pi, 0, 0]}}
    there, said = (op.Problem("panda", "ready", {**pose, **rates}) for rates in ({}, {"velocity": [0.0] * N}))
    assert said.hash == there.hash
    ends = [{"any_of": [{**pose, **rates}]} for rates in ({}, {"velocity": [0.0] * N})]
    there, said = (op.Problem("panda", "ready", task=[{"move": end}]) for end in ends)
    assert said.hash == there.hash


def test_a_goal_of_several_states():
    q = REACH.goal[0].q
    problem = REACH.with_goal([op.State(q), op.State(q, one(0, 0.2)), REACH.start])
    assert [state.v[0] for state in problem.end_states(q)] == [0.0, 0.2]
    assert problem.lower_bounds([q])[0] <= REACH.lower_bounds([q])[0]


def test_rates_beyond_limits_are_refused():
    words = refusal(lambda: REACH.with_start(op.State(REACH.start, one(0, 9.0), one(1, 99.0))))
    assert "start.velocity[0]: panda_joint1 = 9 rad/s, beyond its limit; expected a value in [-2.175, 2.175]" in words
    assert "start.acceleration[1]: panda_joint2 = 99 rad/s², beyond its limit" in words
    slow = REACH.with_limits(velocity=0.1)
    words = refusal(lambda: slow.with_goal(op.State(REACH.goal[0].q, one(0, 0.3))))
    assert (
        "goal.velocity[0]: panda_joint1 = 0.3 rad/s, beyond its limit; expected a value in [-0.2175, 0.2175]" in words
    )


def test_other_counts_and_other_ends_are_refused():
    for few in ([0.1], [0.0], []):
        start = {"joints": REACH.start.tolist(), "velocity": few}
        words = refusal(lambda start=start: op.Problem("panda", start, REACH.goal[0]))
        assert f"start.velocity: {len(few)} values; expected 7 values" in words
    pose = {"pose": {"position": [0.5, 0, 0.5]}, "velocity": [0.1] * N}
    assert "velocity with pose" in refusal(lambda: REACH.with_goal(pose))


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_joint_that_cannot_stop_before_its_limit(side):
    limit = (LIMITS.upper if side > 0 else LIMITS.lower)[3]
    q = REACH.start.copy()
    q[3] = limit - side * 0.02
    into, back = op.State(q, one(3, side * LIMITS.velocity[3])), op.State(q, one(3, -side * LIMITS.velocity[3]))
    words = refusal(lambda: REACH.with_start(into))
    assert "panda_joint4" in words
    assert f"cannot stop before its limit {limit:.6g}" in words
    assert "no motion within its limit" in refusal(lambda: REACH.with_goal(back))
    assert REACH.with_start(back).nonzero_ends
    assert REACH.with_goal(into).with_start(REACH.start) is not None


def test_an_acceleration_that_leads_beyond_the_velocity():
    state = op.State(REACH.start, LIMITS.velocity, LIMITS.acceleration)
    assert "stays within its velocity limit" in refusal(lambda: REACH.with_start(state))


@pytest.mark.parametrize("jerk", [np.inf, 80.0, 500.0])
def test_how_far_a_joint_goes_is_what_the_hardest_braking_gives(jerk):
    """Against the same motion on a fine grid of time."""
    rng = np.random.default_rng(0)
    n, most = 40, 7.0
    limits = replace(LIMITS, **{name: np.full(n, np.inf) for name in ("lower", "upper", "velocity", "torque")})
    limits = replace(limits, acceleration=np.full(n, most), jerk=np.full(n, jerk))
    q, v, a = rng.normal(size=n), rng.normal(size=n), rng.uniform(-most, most, n)
    low, high = furthest(q, v, a, limits)
    t = np.linspace(0.0, 3.0, 300_001)
    for j in range(n):
        for sign, found in ((1.0, high[j]), (-1.0, -low[j])):
            braking = np.maximum(sign * a[j] - jerk * t, -most) if np.isfinite(jerk) else np.full(len(t), -most)
            speed = sign * v[j] + np.concatenate([[0.0], np.cumsum(0.5 * (braking[1:] + braking[:-1]))]) * t[1]
            place = sign * q[j] + np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]))]) * t[1]
            assert found == pytest.approx(place.max(), abs=1e-7)
    slow, fast = fastest_reached(v, a, limits)
    assert (slow <= v).all()
    assert (v <= fast).all()
