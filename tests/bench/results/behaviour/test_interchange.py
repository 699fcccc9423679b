import csv
import json
import math
import sqlite3
from dataclasses import replace

import numpy as np
import pytest

from optiplan.bench.results.database import Store
from optiplan.bench.results.imported import CLAIMED
from optiplan.bench.results.ompl_log import PROPERTIES, STATUS
from optiplan.cli.main import run as main

PLANNERS = ["bench_planners:Straight", {"name": "bench_planners:Leaves", "label": "leaves", "only": "p1"}]


@pytest.fixture
def results(results_of, tmp_path):
    results_of(seeds=[0, 7], planners=PLANNERS)
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
    file.write_text(json.dumps({"plain": [second, first]}))  # in any order
    words = ["bench", "import-results", str(file), str(results), "--out", str(tmp_path / "in"), "--label", "theirs"]
    assert main(words) == 0
    with Store(tmp_path / "in") as there, Store(results) as here:
        rows = there.query("SELECT * FROM runs ORDER BY problem")
        ours = here.query("SELECT * FROM runs WHERE verified ORDER BY problem, planner")
    assert [row["problem"] for row in rows] == ["plain/p0", "plain/p1"]
    row, our = rows[0], ours[0]
    assert (row["planner"], row["timed"], row["verified"], row["failure_kind"]) == ("theirs", 1, 0, CLAIMED)
    assert (row["duration"], row["plan_time"]) == (our["duration"], our["plan_time"])
    turned = json.loads(our["metrics"])["tool_rotation"]
    assert first["eef_orientation_path_length"] == pytest.approx(math.degrees(turned), rel=1e-12)
    assert json.loads(row["metrics"])["tool_rotation"] == pytest.approx(turned, rel=1e-12)
    assert second["motion_time"] > 0
    assert main(["bench", "export", str(tmp_path / "in"), "--format", "ompl"]) == 0
    assert [*parsed((tmp_path / "in" / "ompl" / "plain.log").read_text().splitlines())] == ["theirs"]


@pytest.fixture
def ours(results, tmp_path):
    """Our results on the two problems, and samples of their motions as another program would write them."""
    with Store(results) as store:
        rows = store.query("SELECT * FROM runs WHERE verified AND planner LIKE '%Straight' ORDER BY problem")
        samples = []
        for row in rows:
            motion = store.trajectory(row["trajectory"])
            slow = 2.0 * motion.duration  # no limit is near
            t = np.linspace(0.0, slow, 201)
            s = (t / slow) ** 3 * (10.0 - 15.0 * t / slow + 6.0 * (t / slow) ** 2)
            a, b = motion(0.0), motion.end
            samples.append({"t": t.tolist(), "q": (a + s[:, None] * (b - a)).tolist()})
    return results, samples


def imported(ours, tmp_path, entries, label="bench_planners:Straight"):
    file = tmp_path / "their.json"
    file.write_text(json.dumps(entries))
    out = tmp_path / "in"
    code = main(["bench", "import-results", str(file), str(ours[0]), "--out", str(out), "--label", label])
    if code != 0:
        return code
    with Store(out) as store:
        return {row["problem"]: dict(row) for row in store.query("SELECT * FROM runs")}


def test_trajectories_from_elsewhere_are_verified_here(ours, tmp_path, capsys):
    one, two = ours[1]
    names = ["shoulder", "elbow"]
    header = ["t", *reversed(names)]
    with (tmp_path / "two.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(header)
        writer.writerows([t, *reversed(q)] for t, q in zip(two["t"], two["q"], strict=True))
    entries = [
        {"problem": "plain/p1", "solve_time": 0.25, "success": True, "trajectory": "two.csv"},
        {"problem": "plain/p0", "solve_time": 0.5, "success": True, "motion_time": 9.0, "trajectory": one},
    ]
    rows = imported(ours, tmp_path, entries)
    assert "2 runs in" in (out := capsys.readouterr().out)
    assert "2 with a trajectory, 2 of them verified" in out
    for name, samples, seconds in (("plain/p0", one, 0.5), ("plain/p1", two, 0.25)):
        row = rows[name]
        assert (row["verified"], row["failure_kind"], row["plan_time"]) == (1, None, seconds)
        assert row["duration"] == pytest.approx(samples["t"][-1])  # not what was told
        assert row["duration"] > row["lower_bound"] > 0.0
        assert json.loads(row["metrics"])["tool_path"] > 0.0
        assert json.loads(row["info"])["interpolation"].startswith("cubic spline through the positions")
    with Store(tmp_path / "in") as store:
        np.testing.assert_allclose(store.trajectory(rows["plain/p1"]["trajectory"]).end, two["q"][-1], atol=1e-12)


def test_a_trajectory_that_does_not_keep_to_the_problem_is_refused_whatever_its_authors_say(ours, tmp_path):
    one = ours[1][0]
    hurried = one | {"t": (0.1 * np.array(one["t"])).tolist()}
    entries = {
        "plain": [
            {"problem": "plain/p0", "success": True, "solve_time": 1.0, "trajectory": hurried},
            {"problem": "plain/p1", "success": True, "solve_time": 1.0, "trajectory": one},  # of the other problem
        ]
    }
    rows = imported(ours, tmp_path, entries)
    assert [rows[name]["verified"] for name in ("plain/p0", "plain/p1")] == [0, 0]
    assert {row["failure_kind"] for row in rows.values()} == {"not-verified"}
    assert "velocity" in rows["plain/p0"]["failure_detail"]
    assert "goal" in rows["plain/p1"]["failure_detail"]


def test_imported_runs_are_compared_with_times(ours, tmp_path, capsys):
    entries = [
        {"problem": f"plain/p{k}", "solve_time": 0.5, "success": True, "trajectory": samples}
        for k, samples in enumerate(ours[1])
    ]
    imported(ours, tmp_path, entries)
    capsys.readouterr()
    assert main(["bench", "compare", str(ours[0]), str(tmp_path / "in"), "--json"]) == 0
    changes = {change["quantity"]: change for change in json.loads(capsys.readouterr().out)["changes"]}
    assert changes["planning time"]["after"] == 0.5
    assert changes["duration"]["ratio"] == pytest.approx(2.0, rel=1e-6)
    assert (changes["success"]["before"], changes["success"]["after"]) == (1.0, 1.0)


def test_claims_are_compared_with_times_and_never_as_success(ours, tmp_path, capsys):
    entries = [{"problem": f"plain/p{k}", "solve_time": 0.5, "motion_time": 3.0, "success": True} for k in (1, 0)]
    imported(ours, tmp_path, entries)
    capsys.readouterr()
    assert main(["bench", "compare", str(ours[0]), str(tmp_path / "in"), "--json", "--gate"]) == 0
    data = json.loads(capsys.readouterr().out)
    assert [change["quantity"] for change in data["changes"]] == ["planning time", "duration"]
    assert data["changes"][1]["after"] == 3.0
    assert data["new_failures"] == []
    assert any("2 runs in B have no trajectory" in note for note in data["notes"])


def test_numbers_that_are_not_finite_are_unknown(ours, tmp_path):
    told = {"solve_time": math.nan, "motion_time": 10**400, "success": True, "their": {"own": [math.inf, 1]}}
    (row,) = imported(ours, tmp_path, [{"problem": "plain/p0", **told}]).values()
    assert (row["plan_time"], row["duration"], row["timed"]) == (None, None, 0)
    assert json.loads(row["info"])["their"] == {"own": [None, 1]}


ENTRY = {"problem": "plain/p0", "success": True}


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ({"plain": [{"success": True}]}, "entry 0 of plain: no problem; expected an id of"),
        ([{"problem": "plain/p9"}], "entry 0: problem 'plain/p9'; expected an id of"),
        ([ENTRY, ENTRY], "entry 1: 'plain/p0', seed 0 a second time; expected one entry for each problem and seed"),
        ([ENTRY | {"seed": "one"}], "seed: entry 0: 'one'; expected a whole number"),
        ([ENTRY | {"seed": 2**63}], "seed: entry 0: 9223372036854775808; expected a whole number of 64 bits"),
        ([ENTRY | {"trajectory": {"t": [0, 1]}}], "entry 0: trajectory: t, q: nothing"),
        (
            [ENTRY | {"trajectory": {"t": [0, 0], "q": [[0, 0], [1, 1]]}}],
            "times that are not finite or do not increase",
        ),
        ([ENTRY | {"trajectory": "gone.csv"}], "gone.csv: file: no such file"),
        ([1], "expected {set: [entry, …]} or [entry, …] in JSON"),
        ({"plain": [3]}, "expected {set: [entry, …]} or [entry, …] in JSON"),
        ("nothing", "expected {set: [entry, …]} or [entry, …] in JSON"),
    ],
)
def test_foreign_results_that_are_refused(write_results, tmp_path, capsys, content, said):
    runs = {("plain/p0", "one", 0): (1.0, 2.0)}
    made = write_results(tmp_path / "made", runs, problem=lambda one: replace(one, hash=""))  # the made-up one is none
    assert imported((made, None), tmp_path, content) == 2
    assert said in capsys.readouterr().err
    assert not (tmp_path / "in").exists()
