"""No planner has it better than another: what it is charged with, in which order runs come, what is warm."""

import os
from itertools import groupby

import pytest

from optiplan.bench.execution.pool import LocalPool
from optiplan.bench.execution.runner import open_results, run_suite
from optiplan.bench.suite.suite import load_suite
from optiplan.cli.main import run as main


def test_a_planner_is_charged_with_its_own_processor_time(write_suite, run):
    (row,) = run(write_suite(count=1, planners=["bench_planners:Works"]))[1].values()
    assert 0.09 <= row["plan_cpu"] < 0.19  # with its child, without its sleep
    assert row["cpu_time"] > row["plan_cpu"]  # which has proof and metrics as well


def test_runs_of_a_problem_come_in_a_random_order_that_stays(write_suite, tmp_path):
    planners = [{"name": "bench_planners:Straight", "label": label} for label in "abcdef"]
    suite = load_suite(write_suite(count=6, planners=planners, seeds=[0, 1]), tmp_path / "files")
    tasks = list(suite.tasks())
    assert [task.key for task in suite.tasks()] == [task.key for task in tasks]
    assert len({task.key for task in tasks}) == suite.size == 72
    assert [name for name, _ in groupby(task.problem.id for task in tasks)] == [p.id for p in suite.problems]
    orders = {tuple(task.key[1:] for task in tasks if task.problem.id == p.id) for p in suite.problems}
    assert len(orders) == 6
    assert len({order[0][0] for order in orders}) > 2


def test_every_label_is_warm_on_every_robot(write_suite, tmp_path, monkeypatch):
    monkeypatch.setenv("ASKED", str(tmp_path / "asked"))
    planners = [{"name": "bench_planners:WarmsUp", "label": label, "only": label} for label in "ab"]
    path = write_suite(count=2, planners=planners, repetitions=2)
    other = tmp_path / "problems" / "p1.yaml"
    other.write_text(
        "{version: 1, robot: ur5, start: {joints: [0, -1.5, 1, 0, 1, 0]}, goal: {joints: [1, -1.5, 1, 0, 1, 0]}}"
    )
    suite = load_suite(path, tmp_path / "files")
    with open_results(suite, tmp_path / "out") as store:
        run_suite(suite, store, LocalPool(1), "1 local", lambda outcome: None)
        asked = (tmp_path / "asked").read_text().splitlines()
        rows = store.query("SELECT timings FROM runs WHERE timings LIKE '%warm_up_failed%'")
    assert sorted(line for line in asked if "warm-up" in line) == [
        f"{label} warm-up {robot}" for label in "ab" for robot in ("planar2r", "ur5")
    ]
    assert len(asked) == 12
    for label in "ab":
        for robot in ("planar2r", "ur5"):
            mine = [line for line in asked if line.startswith(label) and line.endswith(robot)]
            assert "warm-up" in mine[0]
    assert rows == []


def test_what_is_drawn_from_the_process_s_generators_no_other_run_decides(write_suite, run, tmp_path):
    path = write_suite(count=2, planners=["bench_planners:Draws"], seeds=[0, 1], repetitions=2)
    rows = run(path)[1]
    drawn = {key: row["info"].partition('"cores"')[0] for key, row in rows.items()}
    by_seed = {seed: {value for key, value in drawn.items() if key[2] == seed} for seed in (0, 1)}
    assert [len(values) for values in by_seed.values()] == [1, 1]
    assert by_seed[0] != by_seed[1]


@pytest.mark.usefixtures("one_figure_of_measures")
def test_pinned_workers_stay_on_a_core_each(write_suite, tmp_path, capsys):
    path = write_suite(count=3, planners=["bench_planners:Draws"])
    words = ["bench", str(path), "--out", str(tmp_path / "out"), "--workers", "1", "--pin"]
    assert main(words) == 0
    suite = load_suite(path, tmp_path / "files")
    with open_results(suite, tmp_path / "out") as store:
        used = {row[0] for row in store.query("SELECT info ->> 'cores' FROM runs")}
        (session,) = store.query("SELECT workers FROM sessions")
    assert used == {f"[{min(os.sched_getaffinity(0))}]"}
    assert session["workers"] == "1 local, each on a core of its own"


@pytest.mark.parametrize("words", [["--workers", "999", "--pin"], ["--dask", "tcp://nowhere:1", "--pin"]])
def test_what_cannot_be_pinned(write_suite, words, capsys):
    assert main(["bench", str(write_suite()), *words]) == 2
    assert "--pin" in capsys.readouterr().err
