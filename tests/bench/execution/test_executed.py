"""The column `executed`: verified motions are followed by computed torque in our plant."""

import json

import pytest

from optiplan.bench.execution import run_task
from optiplan.bench.execution.run_task import TaskExecutor
from optiplan.bench.results.records import BenchPlanner, BenchProblem, BenchTask
from optiplan.problem.load import load_problem, problem_from_dict
from optiplan.simulation import execution


def outcome(problem, planner="trajopt", metrics=None):
    asked = BenchProblem("set/one", "set", None, problem.hash, problem.source, {})
    task = BenchTask(asked, BenchPlanner(planner, planner, {}), 0, 0, 5.0, 60.0, 4000.0, metrics)
    return TaskExecutor()(task, lambda phase: None)


@pytest.fixture(scope="module")
def planar(problems_folder):
    return load_problem(problems_folder / "12_planar.yaml")


@pytest.fixture(scope="module")
def problems_folder():
    from optiplan.resources import problems_dir

    return problems_dir()


def test_a_verified_motion_is_executed(planar):
    row = outcome(planar).row
    assert row.verified
    assert row.executed is True
    assert 0.0 < row.metrics["tool_error_rms"] < 1e-3
    assert row.metrics["executed_clearance"] > 0.0
    assert row.timings["execute"] > 0.0
    json.dumps(row.metrics)


def test_a_suite_keeps_what_it_asks_for(planar):
    assert set(outcome(planar, metrics=("tool_path", "tool_error_peak")).row.metrics) == {
        "tool_path",
        "tool_error_peak",
    }


def test_what_is_not_verified_is_not_tried():
    hard = {"version": 1, "robot": "planar2r", "start": {"joints": [0, 0.5]}, "goal": {"joints": [2.0, 0.5]}}
    row = outcome(problem_from_dict(hard), "bangbang").row  # its jerk is without bound
    assert (row.verified, row.executed) == (False, None)


def test_robots_without_inertias_are_not_tried(problems_folder):
    row = outcome(load_problem(problems_folder / "34_screw_report_d.yaml"), "sclerp").row
    assert row.verified
    assert row.executed is None


def test_one_that_strays_did_not_do_it(planar, monkeypatch):
    weak = execution.ExecutionOptions(frequency=0.05, payload=execution.Payload(2.0, 0.0))
    monkeypatch.setattr(execution.execute, "__defaults__", (weak,))
    row = outcome(planar).row
    assert row.verified
    assert row.executed is False


def test_files_that_were_changed_since_the_suite_was_read_are_not_planned_with(robot_of_ours):
    problem, block = load_problem(robot_of_ours / "p0.yaml"), robot_of_ours / "block.stl"
    block.write_text(block.read_text().replace(".2", ".3"))
    row = outcome(problem, "quintic").row
    assert (row.verified, row.failure_kind) == (False, "changed")
    assert "its meshes were changed since the suite was read" in row.failure_detail


def test_a_run_whose_simulation_has_no_memory_leaves_no_trajectory(robot_of_ours, monkeypatch):
    def refused(done):
        raise MemoryError

    monkeypatch.setattr(run_task, "executed", refused)
    found = outcome(load_problem(robot_of_ours / "p0.yaml"), "quintic")
    assert (found.row.failure_kind, found.row.trajectory, found.trajectory) == ("out-of-memory", None, None)
