"""`tracking_error` of a problem: what can be stated, what it is, and what is refused."""

import re

import numpy as np
import pytest

import optiplan as op
from optiplan.errors import InputError

N = 7


@pytest.fixture(scope="module")
def problem():
    return op.load_problem("01_reach")


@pytest.mark.parametrize(
    ("stated", "error"),
    [
        (0.002, np.full(N, 0.002)),
        (0, np.zeros(N)),
        (np.linspace(0.0, 0.006, N), np.linspace(0.0, 0.006, N)),
        ({f"panda_joint{k}": 0.001 * k for k in range(1, 8)}, 0.001 * np.arange(1, 8)),
    ],
)
def test_a_number_a_list_or_values_by_joint(problem, stated, error, tmp_path):
    found = problem.with_parts(tracking_error=stated)
    np.testing.assert_array_equal(found.tracking_error, error)
    found.save(tmp_path / "problem.yaml")
    again = op.load_problem(tmp_path / "problem.yaml")
    np.testing.assert_array_equal(again.tracking_error, error)
    assert again.hash == found.hash != problem.hash


def test_without_one_nothing_changes(problem):
    assert not problem.tracking_error.any()
    assert "tracking_error" not in problem.source
    assert problem.with_parts(tracking_error=None).hash == problem.hash


@pytest.mark.parametrize(
    ("stated", "words"),
    [
        (-0.001, "a number ≥ 0.0"),
        (float("nan"), "a finite number"),
        ("much", "a number"),
        ([0.1, 0.2], "2 values; expected one number, or 7 values"),
        ({"elbow": 0.1}, "unknown joint 'elbow'"),
        ({"panda_joint1": 0.1}, "no value of panda_joint2"),
    ],
)
def test_what_is_refused(problem, stated, words):
    with pytest.raises(InputError, match=words):
        problem.with_parts(tracking_error=stated)


@pytest.mark.parametrize("stated", [-1.0, [0.1], "much", {"elbow": 0.1}, [0.1] * 6 + [np.inf], True])
def test_the_argument_of_plan_is_named(problem, stated):
    with pytest.raises(InputError, match=r"op\.plan: tracking_error"):
        op.plan(problem, tracking_error=stated)


def test_a_start_nearer_to_its_limit_than_the_error(problem):
    upper = problem.robot.limits.upper
    near = problem.with_start(np.append(problem.start[:-1], upper[-1] - 0.01))
    assert near.with_parts(tracking_error=0.009).tracking_error[0] == 0.009
    words = r"op\.plan: start: panda_joint7 = .* nearer to its limit than the tracking .* a value in \[.*, (.*)\]"
    with pytest.raises(InputError, match=words) as caught:
        op.plan(near, tracking_error=0.011)
    fits = float(re.search(words, str(caught.value))[1])
    farthest = problem.with_start(np.append(problem.start[:-1], fits))
    assert op.plan(farthest, "quintic", tracking_error=0.011).verified


def test_what_rounding_puts_beyond_a_narrower_limit_is_gone_on_from(problem):
    """A motion to the limit ended 4e-15 rad beyond it, and was refused as a start."""
    narrow, limit = problem.with_parts(tracking_error=0.01455), problem.limits.upper[-1] - 0.01455 - 1e-6
    beyond = np.append(problem.start[:-1] + 0.1, limit + 4e-7)
    away = narrow.with_goal(problem.start)
    assert op.plan(away.with_start(beyond), "line").verified
    assert op.plan(narrow.with_goal(beyond), "line").verified
    with pytest.raises(InputError, match="nearer to its limit"):
        away.with_start(np.append(problem.start[:-1], limit + 6e-7))


def test_vias_and_ends_of_moves_nearer_to_a_limit_than_the_error(problem):
    upper = problem.robot.limits.upper
    near = np.append(problem.start[:-1], upper[-1] - 0.01)
    words = r"panda_joint7 = .* nearer to its limit than the tracking"
    with pytest.raises(InputError, match=r"via\[0\]: " + words):
        problem.with_parts(vias=[near], tracking_error=0.011)
    assert problem.with_parts(vias=[op.ViaPoint(near, tolerance=0.01)], tracking_error=0.011).vias
    task = op.Task().move(near).gripper("hand", [0.0])
    with pytest.raises(InputError, match=r"task\[0\]\.move: " + words) as caught:
        op.Problem("panda", "ready", task=task, tracking_error=0.011)
    assert "task[1].gripper: panda_finger_joint1 = 0, nearer" in str(caught.value)
    either = op.Task().move([near, "ready"])
    assert op.Problem("panda", "ready", task=either, tracking_error=0.011).task


def test_a_problem_put_together_by_hand_has_one_too(problem):
    from optiplan.problem.problem import derived

    found = derived(problem, seed=1).with_parts(tracking_error=0.003)
    np.testing.assert_array_equal(found.tracking_error, np.full(N, 0.003))
