"""Planners that misbehave in every way: each is recorded as what it did, and the suite completes."""

import json
import os
import sqlite3
import subprocess
import sys
from pathlib import Path

import pytest

from optiplan.bench.execution.machine import ended
from optiplan.bench.execution.pool import LocalPool
from optiplan.bench.execution.runner import open_results, run_suite
from optiplan.bench.suite.suite import load_suite
from tests.waiting import PATIENCE

FAULTS = {
    "Hangs": "timeout",
    "Eats": "out-of-memory",
    "Gulps": "out-of-memory",
    "Segfaults": "crashed (signal 11)",
    "Raises": "bug",
    "Babbles": "bug",
    "Shrugs": "bug",
    "Stutters": "no-path",
    "Leaves": "crashed (exit 5)",
    "Quits": "bug",
    "Interrupts": "bug",
    "ChildrenEat": "out-of-memory",
    "KilledAlways": "crashed (signal 9)",
    "KilledOnce": None,
    "Prints": None,
    "Floods": None,
    "ClosesItsStreams": None,
    "LeavesChildren": None,
    "ComesBackTwice": None,
}


@pytest.fixture(scope="module")
def rows(tmp_path_factory):
    """One suite of all of them on two problems, the good planner last, made by two workers."""
    folder = tmp_path_factory.mktemp("faults")
    for name in "ab":
        problem = {"version": 1, "robot": "planar2r", "start": {"joints": [0.5, 1.0]}, "goal": {"joints": [-0.5, 1.2]}}
        (folder / f"{name}.yaml").write_text(json.dumps(problem))
    planners = [{"name": f"bench_planners:{name}", "label": name, "only": "a"} for name in (*FAULTS, "Straight")]
    suite = {"version": 1, "name": "faults", "problems": [{"glob": "?.yaml", "set": "s"}], "planners": planners}
    suite |= {"budget": 1, "limits": {"wall": 4, "memory": 300}}
    (folder / "suite.yaml").write_text(json.dumps(suite))
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(Path(__file__).parents[2]))
        patch.setenv("KILLED_ONCE", str(folder / "killed"))
        patch.setenv("CHILDREN", str(folder / "children"))
        suite = load_suite(folder / "suite.yaml", folder / "files")
        with open_results(suite, folder / "out") as store:
            assert run_suite(suite, store, LocalPool(2), "2 local", lambda outcome: None).complete
            stored = {(row["problem"], row["planner"]): dict(row) for row in store.query("SELECT * FROM runs")}
    return stored | {"children": [int(pid) for pid in (folder / "children").read_text().split()]}


@pytest.mark.parametrize("name", FAULTS)
def test_each_is_recorded_as_what_it_did(rows, name):
    row = rows["s/a", name]
    assert row["failure_kind"] == FAULTS[name], row
    assert bool(row["verified"]) == (FAULTS[name] is None)
    assert row["failure_detail"] if FAULTS[name] else row["trajectory"]
    assert row["worker"].startswith("local/")
    assert row["started_at"].startswith("20")


def test_the_good_planner_is_not_disturbed(rows):
    assert all(rows[f"s/{problem}", "Straight"]["verified"] for problem in "ab")
    hashes = {rows["s/a", name]["trajectory"] for name in FAULTS if FAULTS[name] is None}
    assert hashes == {rows["s/a", "Straight"]["trajectory"]}


def test_what_a_planner_prints_is_kept_with_its_run(rows):
    assert rows["s/a", "Prints"]["output"].split("\n")[:3] == ["from Python", "to stderr", "from C"]
    assert rows["s/a", "Floods"]["output"] == ("water " * 2000)[-8000:]
    assert rows["s/a", "Straight"]["output"] == rows["s/b", "Prints"]["output"] == ""


def test_limits_are_kept_to(rows):
    assert 4.0 <= rows["s/a", "Hangs"]["wall_time"] < 20.0
    assert "(phase: run)" in rows["s/a", "Hangs"]["failure_detail"]
    assert rows["s/a", "Eats"]["memory"] < 1400  # twice the limit, and what a worker has anyway
    assert rows["s/a", "Gulps"]["memory"] < 300


def test_a_bug_is_kept_with_its_traceback(rows):
    row = rows["s/a", "Raises"]
    assert row["failure_detail"] == "ZeroDivisionError: of all things"
    assert "in misbehave" in json.loads(row["witness"])["traceback"]


def test_what_a_planner_started_ends_with_its_run(rows):
    assert len(rows["children"]) == 2
    assert all(ended(pid) for pid in rows["children"])


NEVER_WAITS = """
import ctypes, os, subprocess, sys, time
from optiplan.bench.execution.machine import descendants
ctypes.CDLL(None).prctl(36, 1)  # orphans come to us, as to process 1, and nobody waits for them
code = "from optiplan.cli.main import main; main()"
assert subprocess.run([sys.executable, "-c", code, *sys.argv[1:]]).returncode == 0
print(descendants(os.getpid()))
"""


def test_nothing_is_left_where_nobody_reaps_orphans(write_suite, tmp_path, monkeypatch):
    """Not even a zombie: under a parent that takes up orphans and never waits for them."""
    monkeypatch.setenv("CHILDREN", str(tmp_path / "children"))
    names = ("LeavesChildren", "KilledWithChildren", "Daemons")
    planners = [{"name": f"bench_planners:{name}", "label": name, "only": "p0"} for name in names]
    path = write_suite(count=2, planners=planners, limits={"wall": 20, "memory": 600})
    words = ["bench", str(path), "--out", str(tmp_path / "out"), "--workers", "1", "--json"]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    command = [sys.executable, "-c", NEVER_WAITS, *words]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=PATIENCE, check=False)
    assert done.returncode == 0, done.stderr
    with sqlite3.connect(tmp_path / "out" / "results.sqlite") as db:
        told = dict(db.execute("SELECT planner, failure_kind FROM runs WHERE problem LIKE '%p0'"))
    assert told == {"LeavesChildren": None, "KilledWithChildren": "crashed (signal 9)", "Daemons": None}
    assert (tmp_path / "children").read_text()
    assert done.stdout.splitlines()[-1] == "[]"


def test_a_zombie_has_ended():
    child = os.fork()
    if child == 0:
        os._exit(0)
    os.waitid(os.P_PID, child, os.WEXITED | os.WNOWAIT)
    assert os.path.exists(f"/proc/{child}")
    assert ended(child)
    assert not ended(os.getpid())
    os.waitpid(child, 0)
    assert ended(child)
