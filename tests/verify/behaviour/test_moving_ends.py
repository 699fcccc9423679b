"""The verifier holds the motion at both ends against what the problem states there."""

import numpy as np
import pytest

import optiplan as op
from optiplan.problem.problem import derived
from optiplan.trajectory.profiles.state_to_state import fastest
from optiplan.verify.verify import verify

REACH = op.load_problem("01_reach")
N = REACH.robot.n
V, A = 0.2 * REACH.limits.velocity, 0.2 * REACH.limits.acceleration
START, END = op.State(REACH.start, V, A), op.State(REACH.goal[0].q, -V, 0.5 * A)
MOVING = REACH.with_start(START).with_goal(END)
MOTION = fastest(START, END, REACH.limits, REACH.robot.joint_names)


def failed(problem, motion):
    return {check.name: check for check in verify(problem, motion).failures}


def test_what_is_stated_is_met():
    report = verify(MOVING, MOTION)
    assert report.verified
    assert "ends" in {check.name for check in report.checks}


def test_a_motion_that_moves_is_refused_by_a_problem_at_rest():
    found = failed(REACH, MOTION)["rest"]
    assert found.worst == pytest.approx(np.abs(A).max(), rel=0.9)


def test_a_motion_at_rest_is_refused_by_a_problem_that_moves():
    still = op.plan(REACH, "scurve").trajectory
    assert "ends" in failed(MOVING, still)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"start_velocity": V + np.eye(N)[2] * 1e-4}, "velocity at the start"),
        ({"start_velocity": -V}, "velocity at the start"),
        ({"start_acceleration": A + np.eye(N)[1] * 1e-3}, "acceleration at the start"),
        ({"goal": (op.JointGoal(END.q, velocity=V, acceleration=0.5 * A),)}, "velocity at the end"),
        ({"goal": (op.JointGoal(END.q, velocity=-V),)}, "acceleration at the end"),
    ],
)
def test_another_motion_is_refused(change, words):
    found = failed(derived(MOVING, **change), MOTION)["ends"]
    assert words in found.detail
    assert found.worst > found.limit


def test_any_of_several_states_may_be_arrived_in():
    goals = (op.JointGoal(END.q), op.JointGoal(END.q, velocity=-V, acceleration=0.5 * A))
    assert verify(derived(MOVING, goal=goals), MOTION).verified
    assert "ends" in failed(derived(MOVING, goal=goals[:1]), MOTION)


@pytest.mark.parametrize(("off", "met"), [(0.004, True), (0.015, False)])
def test_the_state_is_that_of_the_goal_that_is_reached(off, met):
    beside = op.JointGoal(END.q + off, tolerance=0.01, velocity=-V, acceleration=0.5 * A)
    problem = derived(MOVING, goal=(op.JointGoal(END.q, tolerance=0.01), beside))
    assert failed(problem, MOTION).keys() == (set() if met else {"ends"})
    assert len(problem.end_states(END.q)) == 1 + met


def test_a_stated_acceleration_is_held_without_jerk_limits_too():
    free = MOVING.with_limits(jerk="none")
    wrong = free.with_start(op.State(START.q, V, 0.5 * A))
    assert verify(free, MOTION).verified
    assert "acceleration at the start" in failed(wrong, MOTION)["ends"].detail
