import json
import math
import sqlite3

import pytest

from optiplan.bench.foreign import UNVERIFIED
from optiplan.bench.ompl_log import PROPERTIES, STATUS
from optiplan.bench.store import Store
from optiplan.cli.main import run as main

PLANNERS = ["bench_planners:Straight", {"name": "bench_planners:Leaves", "label": "leaves", "only": "p1"}]


@pytest.fixture
def results(write_suite, run, tmp_path):
    run(write_suite(seeds=[0, 7], planners=PLANNERS))
    return tmp_path / "out"


def parsed(lines):
    """A log by the grammar of OMPL's documentation: settings, properties and runs by planner."""
    lines = iter(lines)
    line = next(line for line in lines if line.endswith(" planners"))
    planners = {}
    for _ in range(int(line.split()[0])):
        name = next(lines)
        settings = dict(next(lines).split(" = ") for _ in range(int(next(lines).split()[0])))
        kinds = dict(next(lines).rsplit(" ", 1) for _ in range(int(next(lines).split()[0])))
        rows = [next(lines).split("; ")[:-1] for _ in range(int(next(lines).split()[0]))]
        assert next(lines) == "."
        planners[name] = (settings, kinds, [dict(zip(kinds, row, strict=True)) for row in rows])
    assert list(lines) == []
    return planners


def test_a_log_follows_the_grammar(results, capsys):
    assert main(["bench", "export", str(results), "--format", "ompl"]) == 0
    assert capsys.readouterr().out.strip() == str(results / "ompl" / "plain.log")
    planners = parsed((results / "ompl" / "plain.log").read_text().splitlines())
    assert list(planners) == ["bench_planners:Straight", "leaves"]
    settings, kinds, rows = planners["leaves"]
    assert settings == {"planner": "bench_planners:Leaves", "only": "p1"}
    assert kinds == PROPERTIES
    assert [(row["seed"], row["solved"], STATUS[int(row["status"])]) for row in rows] == [
        ("0", "1", "Exact solution"),
        ("7", "0", "Unknown status"),
        ("0", "0", "Crash"),
        ("7", "0", "Crash"),
    ]
    assert [row["duration"] == "" for row in rows] == [False, True, True, True]


def test_ompl_s_own_reader_reads_it(results, tmp_path):
    tools = pytest.importorskip("ompl.tools")
    main(["bench", "export", str(results), "--format", "ompl"])
    file = tmp_path / "arena.db"
    tools.readBenchmarkLog(str(file), [str(results / "ompl" / "plain.log")], False)
    with sqlite3.connect(file) as db, Store(results) as store:
        experiment = db.execute("SELECT name, version, runcount, timelimit FROM experiments").fetchone()
        assert experiment[0] == "small/plain"
        assert experiment[1].startswith("OptiPlan ")
        assert experiment[2:] == (4, 2.0)
        sql = "SELECT problem.description, p.name, seed, solved, round(time, 9), round(r.tool_path, 9), why.description"
        joins = "JOIN plannerConfigs p ON p.id = r.plannerid JOIN enums problem ON problem.value = r.problem"
        names = "problem.name = 'problem' AND why.name = 'failure' AND why.value = r.failure"
        found = sorted(db.execute(f"{sql} FROM runs r {joins}, enums why WHERE {names}"), key=str)
        ours = "problem, planner, seed, verified, round(plan_time, 9), round(metrics ->> 'tool_path', 9)"
        wanted = store.query(f"SELECT {ours}, coalesce(failure_kind, 'none') FROM runs")
        assert found == sorted(map(tuple, wanted), key=str)


def test_metrics_out_and_in_again(results, tmp_path, capsys):
    assert main(["bench", "export", str(results), "--format", "robometrics", "--to", str(tmp_path / "to")]) == 0
    file = tmp_path / "to" / "robometrics" / "bench_planners_Straight.json"
    (first, second) = json.loads(file.read_text())["plain"]
    assert (first["success"], first["skip"], first["problem"]) == (True, False, "plain/p0")
    words = ["bench", "import-results", str(file), str(results), "--out", str(tmp_path / "in"), "--label", "theirs"]
    assert main(words) == 0
    with Store(tmp_path / "in") as there, Store(results) as here:
        (row, _) = there.query("SELECT * FROM runs ORDER BY problem")
        ours = here.query("SELECT * FROM runs WHERE verified AND problem = 'plain/p0'")[0]
    assert (row["planner"], row["timed"], row["verified"], row["failure_kind"]) == ("theirs", 1, 0, UNVERIFIED)
    assert (row["duration"], row["plan_time"]) == (ours["duration"], ours["plan_time"])
    turned = json.loads(ours["metrics"])["tool_rotation"]
    assert first["eef_orientation_path_length"] == pytest.approx(math.degrees(turned), rel=1e-12)
    assert json.loads(row["metrics"])["tool_rotation"] == pytest.approx(turned, rel=1e-12)
    assert second["motion_time"] > 0


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ('{"plain": [{}, {}, {}]}', "problem 2 of the set 'plain'; expected 2 problems of that set"),
        ('{"other": [{}]}', "problem 0 of the set 'other'; expected 0 problems"),
        ("[1]", "expected {set: [metrics, …]} in JSON"),
        ('{"plain": [3]}', "expected {set: [metrics, …]} in JSON"),
        ("nothing", "expected {set: [metrics, …]} in JSON"),
    ],
)
def test_foreign_results_that_are_refused(results, tmp_path, capsys, content, said):
    (tmp_path / "their.json").write_text(content)
    assert (
        main(["bench", "import-results", str(tmp_path / "their.json"), str(results), "--out", str(tmp_path / "x")]) == 2
    )
    assert said in capsys.readouterr().err
    assert not (tmp_path / "x").exists()
