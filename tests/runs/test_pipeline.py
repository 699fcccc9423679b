import io
import json
import sys
import time

import numpy as np
import pytest
from rich.console import Console

from optiplan.cli.printing.report import show_run
from optiplan.errors import UnknownChoiceError
from optiplan.planners.base import Budget, announce
from optiplan.planners.point_to_point.quintic import Quintic
from optiplan.planners.registry import PLANNERS
from optiplan.problem.load import problem_from_dict
from optiplan.runs import preparation
from optiplan.runs.pipeline import run
from optiplan.runs.run import versions
from optiplan.trajectory.timing.stops import stop_at_corners
from optiplan.verify.report import jsonable

FREE = {"version": 1, "robot": "planar2r", "start": {"joints": [0.5, 1.0]}, "goal": {"joints": [-0.5, 1.2]}}


def silent(stage, fraction):
    pass


@pytest.fixture(scope="module")
def problem():
    return problem_from_dict(FREE)


def test_a_plan_is_verified_and_measured_by_the_bound(problem):
    result = run(problem, "quintic", {}, Budget(10.0), silent)
    assert result.verified
    assert result.failure is None
    assert result.duration == result.trajectory.duration
    # the shoulder, 1 rad at 2 rad/s, 8 rad/s², 80 rad/s³: 4 * 0.1 + 2 * 0.15 + 0.15 s
    assert result.lower_bound == pytest.approx(0.85, abs=1e-9)
    assert result.ratio == pytest.approx(result.duration / result.lower_bound)


def test_stages_are_told_and_timed(problem):
    told = []
    result = run(problem, "quintic", {}, Budget(10.0), lambda stage, fraction: told.append(stage))
    assert told[-1] == "verify"
    assert set(result.timings) == {"plan", "verify", "measure"}
    assert sum(result.stages.values()) <= result.timings["plan"]


def test_what_is_found_out_once_for_a_robot_costs_no_budget(problem, monkeypatch):
    """A folder without what is kept on disk: the survey of a robot with meshes takes longer than a short budget."""

    def late(robot):
        began = time.process_time()
        while time.process_time() < began + 0.15:
            pass
        return frozenset()

    monkeypatch.setattr(preparation, "apart_neighbours", late)
    timings = run(problem, "quintic", {}, Budget(0.1), silent).timings
    assert timings["robot"] >= 0.15
    assert set(timings) >= {"plan", "verify"}, "the motion was planned and proved within what was left"


def test_the_record_is_json_and_names_what_made_it(problem):
    record = run(problem, "quintic", {}, Budget(10.0), silent).to_dict()
    again = json.loads(json.dumps(jsonable(record), allow_nan=False))
    assert again["hash"] == problem.hash
    assert again["problem"]["robot"] == "planar2r"
    assert again["report"]["verified"] is again["verified"] is True
    assert again["versions"] == versions()
    assert set(again["geometry"]) == {"base", "upper_arm", "forearm", "tip"}


def test_only_the_report_says_verified(problem, monkeypatch):
    def too_fast(self, problem, budget, progress):
        result = plan(self, problem, budget, progress)
        return type(result)(result.trajectory.scaled(result.trajectory.duration / 2), None, {}, {"verified": True})

    plan = Quintic.plan
    monkeypatch.setattr(Quintic, "plan", too_fast)
    result = run(problem, "quintic", {}, Budget(10.0), silent)
    assert not result.verified
    assert result.to_dict()["verified"] is False


def test_no_plan_has_a_failure_and_no_report():
    data = FREE | {"scene": {"obstacles": [{"name": "wall", "shape": {"box": [0.02, 0.6, 0.02]}}]}}
    data["scene"]["obstacles"][0]["pose"] = {"position": [0.74, 0.18, 0.05]}
    result = run(problem_from_dict(data), "quintic", {}, Budget(10.0), silent)
    assert (result.trajectory, result.report, result.duration, result.lower_bound, result.ratio) == (None,) * 5
    assert result.failure.kind == "collision"
    assert result.to_dict()["failure"]["witness"]


def test_nowhere_to_go_has_no_ratio():
    result = run(problem_from_dict(FREE | {"goal": {"joints": [0.5, 1.0]}}), "quintic", {}, Budget(10.0), silent)
    assert result.verified
    assert result.ratio is None


def test_a_bug_of_a_planner_is_not_swallowed(problem, monkeypatch):
    monkeypatch.setattr(Quintic, "plan", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        run(problem, "quintic", {}, Budget(10.0), silent)


def test_a_planner_that_exits_does_not_end_the_program(problem, monkeypatch):
    monkeypatch.setattr(Quintic, "plan", lambda *_: sys.exit(0))
    with pytest.raises(RuntimeError, match=r"SystemExit\(0\)"):
        run(problem, "quintic", {}, Budget(10.0), silent)


@pytest.mark.parametrize("last", [1, 2])
@pytest.mark.parametrize("error", [ValueError("no gain"), SystemExit(0)], ids=["error", "exit"])
def test_a_planner_that_fails_later_leaves_the_best_motion_that_was_proved(problem, monkeypatch, caplog, error, last):
    plan = Quintic.plan

    def fail(planner, problem, budget, progress):
        motion = plan(planner, problem, budget, progress).trajectory
        for factor in (2.0, 1.5)[:last]:
            progress._free = 0.0  # each is proved at once
            announce(progress, motion.scaled(factor * motion.duration))
        announce(progress, motion)  # nobody proved this one, since the last proof was a moment ago
        raise error

    monkeypatch.setattr(Quintic, "plan", fail)
    alone = run(problem, "quintic", {}, Budget(10.0), silent)
    assert alone.verified
    assert alone.duration == min(duration for _, duration in alone.improvements)
    assert len(alone.improvements) == last
    assert alone.info["fault"]["error"].startswith(type(error).__name__)
    assert "in fail" in alone.info["fault"]["traceback"]
    assert "the planner failed" in caplog.text
    shown = io.StringIO()
    show_run(Console(file=shown, width=300), alone)
    assert "note: the planner failed" in shown.getvalue()
    assert "verified" in shown.getvalue()


def test_a_planner_that_fails_with_a_motion_that_does_not_hold_has_failed(problem, monkeypatch):
    def fail(planner, problem, budget, progress):
        motion = stop_at_corners(np.array([[0.5, 1.0], [9.0, 1.0]]), problem.limits, problem.robot.joint_names)
        announce(progress, motion)
        raise ArithmeticError("no gain")

    monkeypatch.setattr(Quintic, "plan", fail)
    with pytest.raises(ArithmeticError, match="no gain"):
        run(problem, "quintic", {}, Budget(10.0), silent)


def test_unknown_planners_and_options_are_errors(problem):
    with pytest.raises(UnknownChoiceError, match=", ".join(sorted(PLANNERS))):
        run(problem, "rrt", {}, Budget(10.0), silent)
    with pytest.raises(UnknownChoiceError, match="option"):
        run(problem, "quintic", {"speed": 2}, Budget(10.0), silent)
