"""Paths of the tool: planned and proved with a free turn, a cone, a fixed turn and stops, or refused."""

import re
from dataclasses import replace

import numpy as np
import pytest

import optiplan as op
from optiplan.collision.model import CollisionModel
from optiplan.planners.base import Budget, Failure, silent
from optiplan.planners.registry import make_planner
from optiplan.planners.seams.posture_ladder import rounded_down
from optiplan.planners.seams.seam_search import FoundSeam, SeamSearch
from optiplan.problem.problem import derived
from tests.checks import named

DOWN = [0, 0, -1]
LINE = [[0.5, -0.1, 0.3], [0.5, 0.0, 0.32], [0.5, 0.1, 0.3]]
PATH_CHECKS = ("path", "path axis", "path speed")


def planned(robot="ur5", points=LINE, speed=0.1, *, before=(), after=(), **keys):
    task = op.Task(tuple(before)).path(points, speed, **({"curve": "spline", "axis": DOWN} | keys))
    return op.plan(op.Problem(robot, "ready", task=op.Task((*task.steps, *after))), budget=60)


def check(run, name):
    return named(run.report, name)


@pytest.fixture(scope="module")
def glue():
    return planned(at=[{"path": 0.05, "do": "on"}, {"path": 0.15, "do": "off"}], lead=0.1)


def test_a_path_is_proved(glue):
    assert glue.report.verified, glue.report.failures
    for name in PATH_CHECKS:
        assert check(glue, name).kind == "continuous"
    assert check(glue, "path speed").worst < 1e-3 * 0.1


def test_events_happen_at_their_lengths_without_a_stop(glue):
    segments = glue.trajectory.segments
    assert [one.kind for one in segments] == ["path", "path", "path", "passing", "path", "passing", "path", "path"]
    on, off = (one for one in segments if one.kind == "passing")
    assert (on.begin, off.begin) == (on.end, off.end)
    assert off.begin - on.begin == pytest.approx(0.1 / 0.1, rel=1e-3)
    assert np.abs(glue.trajectory(on.begin, 1)).max() > 1e-2
    events = glue.trajectory.to_dict()["events"]
    assert [(one["name"], one["t"]) for one in events] == [("on", on.begin), ("off", off.begin)]


def test_the_motion_slowed_down_is_refused(glue):
    slower = glue.trajectory.scaled(1.03 * glue.trajectory.duration)
    report = op.verify(glue.problem, slower)
    assert [one.name for one in report.failures] == ["path speed"]


def test_a_cone_a_turn_and_corners_that_are_rounded():
    pose = {"rpy": [np.pi, 0, 0]}
    points = [{"position": [0.45, -0.1, 0.3], **pose}, {"position": [0.55, -0.1, 0.3], **pose}]
    run = planned(
        points=[*points, {"position": [0.55, 0.0, 0.3], **pose}], curve="line", blend=0.02, axis=None, cone=0.1
    )
    assert run.report.verified, run.report.failures
    assert check(run, "path axis").worst < 0.1


def test_exact_corners_are_stops_of_a_redundant_arm():
    points = [[0.45, -0.1, 0.4], [0.5, -0.1, 0.4], [0.5, -0.05, 0.4]]
    run = planned("panda", points, curve="line", ramp=0.01)
    assert run.report.verified, run.report.failures
    (middle,) = [one for one in run.trajectory.segments if one.kind == "path" and one.name == "path"]
    t = np.linspace(middle.begin, middle.end, 2001)
    assert np.abs(run.trajectory(t[500:1500], 1)).max(axis=1).min() < 1e-2


def test_steps_before_and_after_a_path():
    home = {"move": {"configuration": "ready"}}
    run = planned(points=[[0.5, -0.05, 0.3], [0.5, 0.05, 0.3]], curve="line", before=[home], after=[home])
    assert run.report.verified, run.report.failures
    assert np.allclose(run.trajectory.end, run.problem.robot.configurations["ready"])


def test_a_path_out_of_reach_names_its_first_point_and_the_nearest_pose():
    run = planned(points=[[0.7, 0.0, 0.3], [1.3, 0.0, 0.3]], curve="line")
    assert run.trajectory is None
    assert run.failure.kind == "reach"
    assert "step 1 (path): the tool does not reach its path at" in run.failure.detail
    assert "the nearest pose found is at" in run.failure.detail
    assert 0.05 < run.failure.witness["path"] < 0.4
    assert run.failure.witness["step"] == 1


def test_the_tool_is_brought_to_its_path_within_the_limits_of_the_problem():
    """Those of the robot are wider where a tracking error is stated; what was found beyond them was dropped."""
    problem = op.Problem("panda", "ready", task=op.Path([[0.4, -0.1, 0.2], [0.4, 0.1, 0.2]], 0.1, axis=DOWN))
    narrow = replace(problem.limits, lower=problem.start - 0.85, upper=problem.start + 0.85)
    path, model = problem.task[0].action, CollisionModel(problem.robot, problem.scene)
    failure = SeamSearch(derived(problem, limits=narrow), path, model, None, Budget(5.0), Budget(5.0), silent).run()
    assert failure.kind == "reach"
    nearest = np.array(failure.witness["q"])
    assert (np.abs(nearest - problem.start) <= 0.85 + 1e-9).all()


def test_a_path_whose_share_is_over_has_the_time_that_the_task_has_left(glue):
    """It ended with *the budget of … ended while choosing the posture*, also where steps after it need no time."""
    path, model = glue.problem.task[0].action, CollisionModel(glue.problem.robot, glue.problem.scene)
    own, planner = derived(glue.problem, task=()), make_planner("trajopt", {})
    found = SeamSearch(own, path, model, planner, Budget(60.0), Budget(0.0), silent).run()
    assert isinstance(found, FoundSeam), found


def test_the_end_of_the_time_does_not_hide_what_took_it(glue, monkeypatch):
    path, model = glue.problem.task[0].action, CollisionModel(glue.problem.robot, glue.problem.scene)
    touch = Failure("collision", "the arm touches 'wall'", {"path": 0.1, "q": glue.problem.start.tolist()})
    tries = iter([touch, Failure("budget", "the budget of 60 s ended")])
    monkeypatch.setattr(SeamSearch, "_follow", lambda *_: next(tries))
    found = SeamSearch(derived(glue.problem, task=()), path, model, None, Budget(60.0), Budget(60.0), silent).run()
    assert (found.kind, found.witness) == ("budget", touch.witness)
    assert found.detail == "the budget of 60 s ended; before that: the arm touches 'wall'"


def test_a_speed_beyond_the_arm_names_the_step_and_a_joint():
    run = planned(speed=4.0)
    assert run.trajectory is None
    assert run.failure.kind == "limits"
    assert run.failure.detail.startswith("step 1 (path): 4 m/s is faster than the arm")
    assert run.failure.witness["joint"] in run.problem.robot.joint_names


def test_a_path_through_an_obstacle_names_it():
    box = op.Box("box", (0.1, 0.05, 0.3), (0.5, -0.1, 0.2))
    task = op.Path(LINE, 0.1, curve="spline", axis=DOWN)
    run = op.plan(op.Problem("ur5", "ready", task=task, scene=op.Scene([box])), budget=30)
    assert run.trajectory is None
    assert run.failure.kind == "collision"
    assert "box" in run.failure.detail


@pytest.mark.parametrize(("value", "down"), [(1.7699, 1.7), (0.0899, 0.089), (12.0, 12.0), (0.996, 0.99)])
def test_a_speed_that_is_suggested_is_not_above_the_possible_one(value, down):
    assert rounded_down(value) == pytest.approx(down, abs=0.011 * value)
    assert rounded_down(value) <= value


def test_a_speed_that_is_suggested_works():
    run = planned(speed=1.0)
    said = re.search(r"; ([\d.]+) m/s is possible there", run.failure.detail)
    assert planned(speed=float(said[1])).verified
