"""One bound a problem, whatever end configurations its runs reach."""

import json
from dataclasses import replace

import pytest

from optiplan.bench.execution.run_task import goal_bound
from optiplan.bench.report.analysis import analyse
from optiplan.bench.results.arrays import load_runs
from optiplan.bench.results.database import Store
from optiplan.bench.results.records import BenchPlanner, BenchProblem, Outcome, Row
from optiplan.cli.main import run as main
from optiplan.problem.load import load_problem, problem_from_dict
from optiplan.resources import problems_dir

TWO_GOALS = {
    "version": 1,
    "robot": "planar2r",
    "start": {"joints": [0.5, 1.0]},
    "goal": {"any_of": [{"joints": [-1.5, 1.0]}, {"joints": [0.4, 1.0]}]},
}

ROWS = {
    "far": {"duration": 2.07, "lower_bound": 2.045, "verified": True},
    "near": {"duration": 1.33, "lower_bound": 0.936, "verified": True},
    "refused": {"duration": 1.0, "lower_bound": 0.1, "verified": False, "failure_kind": "not-verified"},
}
"""What a goal that many configurations satisfy gave: the longer motion at 1.012 beside the shorter at 1.421."""


@pytest.fixture
def store(tmp_path):
    """A problem of two runs that end in different configurations and of one that was refused, and one without a way."""
    parts = {"seeds": [0], "repetitions": 1, "budget": 5.0, "limits": {"wall": 9.0, "memory": 500}, "metrics": None}
    parts |= {"planners": {label: ["quintic", {}] for label in ROWS}, "problems": {"s/many": [], "s/still": []}}
    meta = {"name": "made", "suite": "", "suite_hash": "", "parts": parts, "code": {}}
    problems = tuple(BenchProblem(f"s/{name}", "s", None, name, {}, {}) for name in ("many", "still"))
    with Store.create(tmp_path / "out", meta) as store:
        store.fill(problems, tuple(BenchPlanner(label, "quintic", {}) for label in ROWS))
        store.begin("made up", {"host": "h", "cpu": "c", "cores": 1}, {})
        for label, row in ROWS.items():
            run = Row("s/many", label, 0, 0, "s", None, planned=True, timed=True, plan_time=1.0)
            store.add(Outcome(replace(run, **row)))
            store.add(Outcome(replace(run, problem="s/still", **row | {"lower_bound": 1e-9})))
        yield store


def test_ratios_are_ordered_as_durations_are(store):
    rows = {row["planner"]: dict(row) for row in store.query("SELECT * FROM rated WHERE problem = 's/many'")}
    assert {row["problem_bound"] for row in rows.values()} == {0.936}
    assert rows["far"]["ratio"] == pytest.approx(2.07 / 0.936)
    assert rows["near"]["ratio"] == pytest.approx(1.33 / 0.936)
    assert rows["near"]["ratio"] < rows["far"]["ratio"]
    assert rows["far"]["lower_bound"] == 2.045  # of its own end configuration: stays


def test_configurations_that_the_problem_lists_count_although_nobody_reached_them(store):
    store._db.execute("UPDATE runs SET goal_bound = 0.5 WHERE problem = 's/many' AND planner = 'refused'")
    assert {row[0] for row in store.query("SELECT problem_bound FROM rated WHERE problem = 's/many'")} == {0.5}


def test_a_problem_solved_where_it_starts_has_no_ratio(store):
    assert {row[0] for row in store.query("SELECT ratio FROM rated WHERE problem = 's/still'")} == {None}


def test_report_summary_and_exports_use_it(store, tmp_path, capsys):
    far, near, _ = analyse(store).planners
    assert (far.ratio.median.value, near.ratio.median.value) == pytest.approx((2.07 / 0.936, 1.33 / 0.936))
    assert load_runs(store).ratio[load_runs(store).problem == 0] == pytest.approx(
        [2.07 / 0.936, 1.33 / 0.936, 1 / 0.936]
    )
    assert main(["bench", "export", str(tmp_path / "out"), "--format", "ompl"]) == 0
    log = (tmp_path / "out" / "ompl" / "s.log").read_text()
    assert str(2.07 / 0.936) in log
    assert str(2.07 / 2.045) not in log
    assert main(["bench", "report", str(tmp_path / "out"), "--markdown", str(tmp_path / "table.md")]) == 0
    words = " ".join((tmp_path / "table.md").read_text().split())
    assert "The bound is one for each problem, the least over the end configurations" in words


def test_the_bound_of_listed_goals_is_the_least():
    problem = problem_from_dict(TWO_GOALS)
    near = problem_from_dict(TWO_GOALS | {"goal": {"joints": [0.4, 1.0]}})
    far = problem_from_dict(TWO_GOALS | {"goal": {"joints": [-1.5, 1.0]}})
    assert goal_bound(problem) == goal_bound(near) < goal_bound(far)
    assert goal_bound(load_problem(problems_dir() / "08_pose.yaml")) is None


def test_a_suite_stores_it(write_suite, run):
    (row,) = run(write_suite(count=1))[1].values()
    assert row["goal_bound"] == row["lower_bound"] <= row["duration"]
    assert json.loads(row["info"]) == {"cut_short": False}
