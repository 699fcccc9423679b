"""Steps between two stops are optimised as one: what need not stop does not, and constraints hold."""

import numpy as np
import pytest

import optiplan as op

DOWN = (np.pi, 0.0, 0.0)


def speeds(run):
    """The largest speed of a joint at the end of every step but the last."""
    return [np.abs(run.trajectory(segment.end, 1)).max() for segment in run.trajectory.segments[:-1]]


def test_moves_pass_what_lies_between_them():
    task = op.Task().move(op.Pose((0.5, 0.2, 0.4), rpy=DOWN)).move(op.Pose((0.4, -0.2, 0.5), rpy=DOWN)).move("ready")
    run = op.plan(op.Problem("panda", "ready", task=task), budget=60.0)
    assert run.verified, run.failure or run.report
    assert min(speeds(run)) > 0.1
    assert run.info["stops"] == []
    assert run.duration <= run.info["duration_joined"] <= run.info["duration_with_stops"]


def test_a_move_with_a_constraint_does_not_stop_between_lines():
    cone = {"orientation": {"frame": "panda_hand_tcp", "axis": [0, 0, 1], "toward": [0, 0, -1], "within": 0.15}}
    task = (
        op.Task()
        .move(op.Pose((0.5, -0.25, 0.25), rpy=DOWN))
        .line(by=(0, 0, 0.1))
        .move(op.Pose((0.45, 0.25, 0.35), rpy=DOWN), path_constraints=[cone])
        .line(by=(0, 0, -0.1), speed=0.4)
    )
    run = op.plan(op.Problem("panda", "ready", task=task), budget=60.0)
    assert run.verified, run.failure or run.report
    assert min(speeds(run)[1:]) > 0.1
    assert run.duration < run.info["duration_with_stops"]
    assert {"orientation", "line"} <= {check.name.split(":")[0].split(" ")[0] for check in run.report.checks}


def test_a_step_with_nothing_to_do_is_a_stop():
    task = op.Task().move("ready").line(by=(0, 0, 0.1)).line(by=(0, 0, -0.1))
    run = op.plan(op.Problem("panda", "ready", task=task), budget=60.0)
    assert run.verified, run.failure or run.report
    whys = [stop["why"] for stop in run.info["stops"]]
    assert "it is there already" in whys[0]
    assert whys[1] == "a line straight back"


def test_other_objectives_are_joined_only():
    task = op.Task().move(op.Pose((0.5, 0.2, 0.4), rpy=DOWN)).line(by=(0, 0, -0.1))
    problem = op.Problem("panda", "ready", task=task, objective=op.Objective(time=1.0, jerk=1e-7))
    run = op.plan(problem, budget=60.0)
    assert run.verified
    assert run.duration == pytest.approx(run.info["duration_joined"])
