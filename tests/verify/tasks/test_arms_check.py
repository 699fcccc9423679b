"""Arms beside each other: what is proved of when they do their steps."""

from dataclasses import replace

import numpy as np
import pytest

import optiplan as op
from optiplan.errors import InputError
from optiplan.problem.load import problem_from_dict
from optiplan.problem.task.timeline import mismatch

ROBOTS = {
    "a": {"use": "planar2r"},
    "b": {"use": "planar2r", "base": {"position": [1.6, 0.36, 0], "rpy": [0, 0, np.pi]}},
    "c": {"use": "planar2r", "base": {"position": [0, 3, 0]}},
}
"""The forearms of a and b turn in one plane and point at each other; c stands apart, and no step moves it."""
DOWN = {"joints": [1.2, 0.0]}
STANDS = {"tip_over": {"corners": [[-3, -3], [3, -3], [3, 3], [-3, 3]], "height": -2}}
APART = {"clearance": {"pairs": [["a/forearm", "b/forearm"]], "at_least": 0.01}}
FIRST, SECOND = {"arm": "a", "name": "first", "move": DOWN}, {"arm": "b", "name": "second", "move": DOWN}


def problem_of(*steps):
    start = {"joints": [-1.2, 0.0, -1.2, 0.0, 0.0, 0.0]}
    data = {"version": 1, "robots": ROBOTS, "start": start, "task": list(steps), "planner": "quintic"}
    return problem_from_dict(data)


@pytest.fixture(scope="module")
def both():
    """Both forearms turn past each other: at the same time they would meet."""
    return op.plan(problem_of(FIRST, SECOND), budget=10.0)


def found(report):
    return {check.name for check in report.failures}


def test_arms_that_would_meet_go_one_after_the_other_as_closely_as_they_can(both):
    assert both.verified, both.report and both.report.failures
    first, second = both.trajectory.segments
    alone = op.plan(problem_of(FIRST), budget=5.0).duration
    assert alone == pytest.approx(first.end - first.begin)
    assert 0.0 < second.begin < alone
    assert alone < both.duration < 1.95 * alone


def test_the_verdict_covers_every_statement_of_arms(both):
    names = {one for check in both.report.checks for one in check.covers}
    assert "task.arms" in names
    waits = op.plan(problem_of(FIRST, {**SECOND, "wait_for": "first"}), budget=5.0)
    assert waits.verified
    assert waits.trajectory.segments[1].begin >= waits.trajectory.segments[0].end
    assert "task[1].wait[1]" in {one for check in waits.report.checks for one in check.covers}
    assert not op.verify(waits.problem, both.trajectory).verified  # b begins before a has arrived


def test_an_arm_that_moves_outside_its_steps_is_refused(both):
    first, second = both.trajectory.segments
    later = replace(second, begin=second.begin + 0.4)
    report = op.verify(both.problem, replace(both.trajectory, segments=(first, later)))
    assert found(report) == {"arms"}
    sooner = replace(first, end=first.end - 0.3)
    assert {"arms", "goal"} <= found(op.verify(both.problem, replace(both.trajectory, segments=(sooner, second))))


def test_a_joint_of_no_arm_must_not_move(both):
    c = both.trajectory.coefficients.copy()
    c[0, 1, 4] = 1e-3 / both.trajectory.breakpoints[1]
    c[1:, 0, 4] += 1e-3
    moved = op.Trajectory(both.trajectory.joint_names, both.trajectory.breakpoints, c, both.trajectory.segments)
    assert "arms" in found(op.verify(both.problem, moved))


def test_segments_out_of_order_or_of_no_time_are_no_steps(both):
    problem, motion = both.problem, both.trajectory
    first, second = motion.segments
    assert mismatch(problem, motion) == ""
    assert "order of their times" in mismatch(problem, replace(motion, segments=(second, first)))
    for wrong in (replace(second, end=2.0 * second.end), replace(second, begin=float("nan"))):
        assert mismatch(problem, replace(motion, segments=(first, wrong)))


@pytest.mark.parametrize(
    ("steps", "words"),
    [
        ((FIRST, {"move": DOWN}), r"task\[1\].arm: a step without `arm`"),
        ((FIRST, {**SECOND, "arm": "d"}), r"task\[1\].arm: unknown arm 'd'"),
        ((FIRST, {**SECOND, "wait_for": "third"}), r"task\[1\].wait_for: 'third', no name of an earlier step"),
        (({**FIRST, "wait_for": "second"}, SECOND), r"task\[0\].wait_for: 'second', no name of an earlier step"),
        ((FIRST, {**FIRST, "name": "next", "wait_for": "first"}), r"task\[1\].wait_for: 'first'"),
        (
            (FIRST, {**SECOND, "name": "first"}, {"arm": "c", "dwell": 1.0, "wait_for": "first"}),
            r"task\[2\].wait_for: 'first', the name of steps of a and of b",
        ),
        (({"move": {"joints": [1.2, 0, 0, 0, 0, 0]}, "wait_for": "x"},), "wait_for: a step without `arm`"),
        ((FIRST, {"arm": "b", "move": {"group": "a", **DOWN}}), "joint a/shoulder, which steps of a and of b move"),
        ((FIRST, {"arm": "b", "dwell": 1.0}), "steps of b that move no joint"),
        ((FIRST, {**SECOND, "path_constraints": [STANDS]}), "`tip_over` of one step beside other arms"),
        ((FIRST, {**SECOND, "path_constraints": [APART]}), "`clearance` of one step beside other arms"),
    ],
)
def test_wrong_arms_are_named(steps, words):
    with pytest.raises(InputError, match=words):
        problem_of(*steps)


def test_a_step_waits_for_another_arm_whose_step_has_the_name_of_one_of_its_own():
    problem = problem_of(FIRST, {**SECOND, "name": "first"}, {**SECOND, "name": "third", "wait_for": "first"})
    assert [step.waits for step in problem.task] == [(), (), (1,)]


def test_a_via_of_one_arm_is_passed_while_another_is_on_its_way():
    """Both move from the beginning: where c is then says nothing about whether a passes its via."""
    past = {
        "arm": "a",
        "name": "first",
        "move": {"joints": [-0.2, 0.0], "via": [{"joints": [-0.7, 0.0], "tolerance": 0.01}]},
    }
    run = op.plan(problem_of(past, {"arm": "c", "name": "second", "move": {"joints": [0.6, 0.0]}}), budget=10.0)
    assert run.verified, run.report and run.report.failures
    first, second = run.trajectory.segments
    assert second.begin < first.end
    missed = {**past, "move": {"joints": [-0.2, 0.0], "via": [{"joints": [-0.7, 0.2], "tolerance": 0.01}]}}
    report = op.verify(
        problem_of(missed, {"arm": "c", "name": "second", "move": {"joints": [0.6, 0.0]}}), run.trajectory
    )
    assert "via" in found(report)


HELD = {"name": "box", "link": "a/forearm", "shape": {"sphere": 0.02}, "pose": {"position": [0.3, 0, 0.2]}}


@pytest.mark.parametrize(
    ("step", "words"),
    [
        ({"arm": "b", "detach": {"object": "box"}}, "'box', which a holds; expected what b holds"),
        (
            {**SECOND, "path_constraints": [{"tool_speed": {"linear": 1.0, "frame": "box"}}]},
            r"path_constraints: 'box', which a holds; expected what b holds, or a frame of a robot",
        ),
        (
            {"arm": "b", "move": {"pose": {"position": [1, 0.2, 0.2], "rpy": [0, 0, 0], "frame": "box"}}},
            r"task\[1\].move: 'box', which a holds; expected what b holds",
        ),
        ({"arm": "b", "line": {"frame": "box", "by": [0, 0, 0.1]}}, r"task\[2\].line: 'box', which a holds"),
    ],
)
def test_what_one_arm_holds_at_first_is_not_another_ones(step, words):
    data = problem_of(FIRST, SECOND).source
    task = [FIRST, step] if "move" in step else [FIRST, SECOND, step]
    with pytest.raises(InputError, match=words):
        problem_from_dict({**data, "scene": {"attached": [HELD]}, "task": task})
