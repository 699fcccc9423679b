"""Which code runs are made with, and what happens when it changes."""

import json
import os
import sqlite3
import subprocess
import sys
from pathlib import Path

import pytest

import optiplan
from optiplan.bench.execution.code_version import own_code, own_digest, planner_code
from optiplan.bench.execution.pool import LocalPool
from optiplan.bench.execution.runner import open_results, run_suite
from optiplan.bench.results.imported import read_results
from optiplan.bench.results.records import ChangedError
from optiplan.bench.suite.suite import load_suite
from optiplan.cli.main import run as main
from optiplan.errors import InputError

PLANNER = '''
from dataclasses import dataclass
from helping import SECONDS
from bench_planners import Straight
@dataclass(frozen=True)
class Options:
    file: str = ""
class Mine(Straight):
    """Mine."""
    Options = Options
    def plan(self, problem, budget, progress):
        return Straight(Straight.Options(SECONDS)).plan(problem, budget, progress)
'''


@pytest.fixture
def mine(tmp_path, monkeypatch):
    """A planner of one module that imports another beside it."""
    folder = tmp_path / "code"
    folder.mkdir()
    (folder / "minemine.py").write_text(PLANNER)
    (folder / "helping.py").write_text("SECONDS = 0.0\n")
    (folder / "other.py").write_text("SECONDS = 0.0\n")
    monkeypatch.syspath_prepend(str(folder))
    for name in ("minemine", "helping"):  # of another test
        monkeypatch.delitem(sys.modules, name, raising=False)
    return folder


def test_the_code_of_a_planner_is_its_module_and_what_that_imports_beside_it(mine, tmp_path):
    before = planner_code("minemine:Mine", {})
    assert before == planner_code("minemine:Mine", {})
    (mine / "other.py").write_text("SECONDS = 1.0\n")
    assert planner_code("minemine:Mine", {}) == before
    (mine / "helping.py").write_text("SECONDS = 0.01\n")
    assert planner_code("minemine:Mine", {}) != before


def test_the_code_of_a_package_is_all_of_it(tmp_path, monkeypatch):
    folder = tmp_path / "packagedplanner" / "deep"
    folder.mkdir(parents=True)
    for name in ("__init__.py", "deep/__init__.py", "deep/one.py"):
        (tmp_path / "packagedplanner" / name).write_text("")
    monkeypatch.syspath_prepend(str(tmp_path))
    before = planner_code("packagedplanner.deep:Mine", {})
    (folder / "one.py").write_text("x = 1\n")
    assert planner_code("packagedplanner.deep:Mine", {}) != before


def test_a_file_that_an_option_names_counts(tmp_path):
    script = tmp_path / "peer.py"
    script.write_text("1")
    before = planner_code("optiplan.bench.peers:Peer", {"adapter": str(script)})
    script.write_text("2")
    assert planner_code("optiplan.bench.peers:Peer", {"adapter": str(script)}) != before != ""
    assert planner_code("quintic", {}) == ""


def test_our_code_is_told_by_version_commit_and_content():
    folder = Path(optiplan.__file__).parents[1]
    words = own_code().split()
    assert words[0] == optiplan.__version__
    assert words[-1] == own_digest()[:12]
    if (folder / ".git").exists():
        commit = subprocess.run(["git", "rev-parse", "HEAD"], cwd=folder, capture_output=True, text=True, check=True)
        assert commit.stdout.startswith(words[1].rstrip("+"))


def test_every_row_tells_its_code_also_of_a_process_that_crashed(write_suite, run, mine):
    rows = run(write_suite(count=1, planners=["minemine:Mine", "bench_planners:Leaves", "quintic"]))[1]
    assert {row["optiplan"] for row in rows.values()} == {own_code()}
    assert [rows["plain/p0", name, 0, 0]["code"] == "" for name in ("minemine:Mine", "quintic")] == [False, True]
    crashed = rows["plain/p0", "bench_planners:Leaves", 0, 0]
    assert crashed["failure_kind"].startswith("crashed")
    assert crashed["code"] == planner_code("bench_planners:Leaves", {})


def test_changed_code_of_a_planner_is_refused(write_suite, run, mine):
    path = write_suite(planners=["minemine:Mine", "quintic"])
    run(path)
    (mine / "helping.py").write_text("SECONDS = 0.01\n")
    with pytest.raises(InputError, match="other code: code: changed files of the planners minemine:Mine"):
        run(path)
    (mine / "helping.py").write_text("SECONDS = 0.0\n")
    assert run(path)[0].made == 0


def test_changed_code_of_ours_is_refused(results_of, run, tmp_path):
    path = results_of(count=1)
    with sqlite3.connect(tmp_path / "out" / "results.sqlite") as db:
        db.execute(
            """UPDATE meta SET value = json_set(value, '$.digest', 'x', '$.optiplan', '9 abc') WHERE key='code'"""
        )
    with pytest.raises(InputError, match=r"optiplan 9 abc there, .* here"):
        run(path)


def test_code_that_changes_while_a_suite_runs_ends_it(write_suite, run, mine):
    path = write_suite(count=4, planners=["minemine:Mine", "bench_planners:KilledAlways"])

    def change(outcome):
        (mine / "helping.py").write_text("SECONDS = 0.02\n")

    with pytest.raises(ChangedError, match="'minemine:Mine' or of optiplan was changed"):
        run(path, watch=change)


def test_files_that_change_end_a_suite_and_an_import(write_suite, robot_of_ours, tmp_path):
    path = write_suite(planners=["quintic"], problems=[{"glob": str(robot_of_ours / "p*.yaml")}])
    suite, block = load_suite(path, tmp_path / "files"), robot_of_ours / "block.stl"
    block.write_text(block.read_text().replace(".2", ".3"))
    file, out = tmp_path / "their.json", tmp_path / "in"
    file.write_text(json.dumps([{"problem": "ours/p0", "trajectory": {"t": [0, 1, 2], "q": [[0], [0.1], [0.2]]}}]))
    with open_results(suite, tmp_path / "out") as store:
        with pytest.raises(ChangedError, match=r"ours/p\d: its robot or its meshes were changed"):
            run_suite(suite, store, LocalPool(1), "1 local", lambda outcome: None)
        assert not store.done()
        with pytest.raises(ChangedError, match="ours/p0: its robot or its meshes were changed"):
            read_results(file, "theirs", store, out)
    assert not out.exists()


@pytest.mark.usefixtures("one_figure_of_measures")
def test_a_planner_that_cannot_be_made_is_that_planner_s_failure(write_suite, tmp_path, capsys):
    path = write_suite(count=1, planners=["bench_planners:NeverMade", "bench_planners:Straight"])
    assert main(["bench", str(path), "--out", str(tmp_path / "out"), "--workers", "1", "--json"]) == 0
    data = json.loads(capsys.readouterr().out)
    assert data["failures"] == {"bug": 1}
    assert data["planners"]["bench_planners:Straight"]["verified"] == 1.0
    with sqlite3.connect(tmp_path / "out" / "results.sqlite") as db:
        detail, witness = db.execute("SELECT failure_detail, witness FROM runs WHERE NOT verified").fetchone()
    assert detail == "OSError: no licence"
    assert "bench_planners.py" in json.loads(witness)["traceback"]


def test_results_of_the_first_schema_are_read_and_not_gone_on_with(results_of, run, tmp_path, capsys):
    path = results_of(count=1)
    with sqlite3.connect(tmp_path / "out" / "results.sqlite") as db:
        for column in ("goal_bound", "plan_cpu", "optiplan", "code", "improvements"):
            db.execute(f"ALTER TABLE runs DROP COLUMN {column}")
        db.execute("ALTER TABLE runs ADD COLUMN ratio REAL")
        db.execute("UPDATE meta SET value = '1' WHERE key = 'schema_version'")
        db.execute("DELETE FROM meta WHERE key = 'code'")
    assert main(["bench", "report", str(tmp_path / "out")]) == 0
    assert main(["bench", "export", str(tmp_path / "out"), "--format", "csv"]) == 0
    assert (tmp_path / "out" / "runs.csv").read_text().splitlines()[0].split(",").count("ratio") == 1
    with pytest.raises(InputError, match="code: not recorded there"):
        run(path)
    assert os.path.exists(tmp_path / "out" / "report.html")
