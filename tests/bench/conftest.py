"""Suites small enough to be run in a blink: a planar arm, planners of the tests' own."""

import json
import shutil
from pathlib import Path

import pytest

from optiplan.bench.execution.pool import LocalPool
from optiplan.bench.execution.runner import open_results, run_suite
from optiplan.bench.report.figures import measure_figures
from optiplan.bench.results.database import Store
from optiplan.bench.results.records import BenchPlanner, BenchProblem, Outcome, Row
from optiplan.bench.suite.suite import load_suite

PROBLEM = """\
version: 1
name: {name}
robot: planar2r
start: {{joints: [0.5, 1.0]}}
goal: {{joints: [-0.5, {end}]}}
scene: {{obstacles: [{{name: far, shape: {{sphere: 0.1}}, pose: {{position: [-1, 0.18, 1]}}}}]}}
"""


@pytest.fixture
def planners(monkeypatch):
    """Makes `bench_planners` known here and in workers."""
    monkeypatch.syspath_prepend(str(Path(__file__).parent))


@pytest.fixture
def write_suite(tmp_path, planners):
    """Writes a suite of so many problems; keys are put into the file as they are."""

    def write(count=2, name="small", **keys):
        folder = tmp_path / "problems"
        folder.mkdir(exist_ok=True)
        for index in range(count):
            text = PROBLEM.format(name=f"p{index}", end=1.0 + 0.1 * index)
            (folder / f"p{index}.yaml").write_text(text)
        data = {"version": 1, "name": name, "problems": [{"glob": "problems/p*.yaml", "set": "plain"}]}
        data |= {"planners": ["bench_planners:Straight"], "budget": 2, "limits": {"wall": 20, "memory": 2000}}
        path = tmp_path / f"{name}.yaml"
        path.write_text(json.dumps(data | keys))
        return path

    return write


@pytest.fixture
def run(tmp_path):
    """Runs a suite file into a folder: the summary and all rows by key."""

    def run(path, folder=None, workers=1, watch=lambda outcome: None):
        suite = load_suite(path, tmp_path / "files")
        with open_results(suite, folder or tmp_path / "out") as store:
            done = run_suite(suite, store, LocalPool(workers), f"{workers} local", watch)
            rows = {tuple(row)[:4]: dict(row) for row in store.query("SELECT * FROM runs")}
        return done, rows

    return run


@pytest.fixture(scope="session")
def kept_results():
    """Folders of results by the suite that was run, for all tests of this process."""
    return {}


@pytest.fixture
def results_of(write_suite, run, tmp_path, tmp_path_factory, kept_results):
    """Writes a suite and puts its results into `out` of this test, copied where another test ran the same before."""

    def results_of(**keys):
        path, said = write_suite(**keys), json.dumps(keys, sort_keys=True)
        if said in kept_results:
            shutil.copytree(kept_results[said], tmp_path / "out")
        else:
            run(path)
            kept_results[said] = tmp_path_factory.mktemp("results") / "out"
            shutil.copytree(tmp_path / "out", kept_results[said])
        return path

    return results_of


def _first_measure(analysis):
    return measure_figures(analysis)[:1]


@pytest.fixture
def one_figure_of_measures(monkeypatch):
    """Pages and files with one figure of a measure instead of 18, which are drawn alike."""
    for module in ("figures", "page"):
        monkeypatch.setattr(f"optiplan.bench.report.{module}.measure_figures", _first_measure)


TETRAHEDRON = """\
solid tetrahedron
facet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 0 .1 0\nvertex .1 0 0\nendloop\nendfacet
facet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex .1 0 0\nvertex 0 0 .1\nendloop\nendfacet
facet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 0 0 .1\nvertex 0 .1 0\nendloop\nendfacet
facet normal 0 0 0\nouter loop\nvertex .1 0 0\nvertex 0 .1 0\nvertex 0 0 .1\nendloop\nendfacet
endsolid tetrahedron
"""

URDF = """\
<robot name="arm">
  <link name="base"/>
  <link name="arm"><collision><geometry><mesh filename="file://{folder}/meshes/link.stl"/></geometry></collision></link>
  <joint name="turn" type="revolute">
    <parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>
    <limit lower="-2" upper="2" velocity="2" effort="10"/>
  </joint>
</robot>
"""

OURS = """\
version: 1
robot: robot.yaml
start: {start}
goal: {{joints: [1.0]}}
scene:
  obstacles: [{{name: block, shape: {{mesh: {{file: block.stl}}}}, pose: {{position: [1, 1, 0]}}}}]
"""


@pytest.fixture
def robot_of_ours(tmp_path):
    """Folder of two problems and of a robot that is not shipped, whose URDF names a mesh by its absolute path."""
    folder = tmp_path / "ours"
    (folder / "meshes").mkdir(parents=True)
    (folder / "meshes" / "link.stl").write_text(TETRAHEDRON)
    (folder / "block.stl").write_text(TETRAHEDRON.replace(".1", ".2"))
    (folder / "arm.urdf").write_text(URDF.format(folder=folder))
    limits = "limits: {acceleration: 5, jerk: 50}"
    (folder / "robot.yaml").write_text(f"version: 1\nname: arm\nurdf: arm.urdf\ntool_frame: arm\n{limits}\n")
    for index in range(2):
        (folder / f"p{index}.yaml").write_text(OURS.format(start=f"{{joints: [{0.1 * index}]}}"))
    return folder


@pytest.fixture
def results(tmp_path, write_results):
    """`write_results` into a folder of this test, by name."""
    return lambda runs, name="out", **given: write_results(tmp_path / name, runs, **given)


@pytest.fixture(scope="session")
def write_results():
    """Writes results that no planner made: runs by problem, planner, seed; a number verifies, a pair is a failure.

    `{("s/a", "one", 0): (1.0, 2.0), ("s/a", "two", 0): ("budget", "no path within 5 s")}`: planning time and duration
    (s), or kind and words.
    """
    return _write_results


def _write_results(folder, runs, **given):
    problems, planners, seeds = (list(dict.fromkeys(key[k] for key in runs)) for k in range(3))
    data = {"version": 1, "name": "p", "robot": "planar2r"}
    data |= {"start": {"joints": [0.5, 1.0]}, "goal": {"joints": [-0.5, 1.2]}}
    parts = {"seeds": seeds, "repetitions": 1, "budget": 5.0, "limits": {"wall": 9.0}, "metrics": None}
    parts |= {"planners": {label: ["quintic", {}] for label in planners}, "problems": {id_: [id_] for id_ in problems}}
    meta = {"name": "made <up>", "suite": "a: <b>\n", "suite_hash": folder.name, "parts": parts}
    found = [BenchProblem(id_, id_.split("/")[0], None, id_, data, {}) for id_ in problems]
    if "problem" in given:
        found = [given["problem"](one) for one in found]
    sets = {one.id: (one.set_name, one.difficulty) for one in found}
    with Store.create(folder, meta) as store:
        store.fill(tuple(found), tuple(BenchPlanner(label, "quintic", {}) for label in planners))
        store.begin("made up", {"cpu": given.get("cpu", "one"), "cores": 2}, {"optiplan": "0"})
        for (problem, planner, seed), outcome in runs.items():
            row = dict(zip(("problem", "planner", "seed", "repetition"), (problem, planner, seed, 0), strict=True))
            row |= dict(zip(("set_name", "difficulty"), sets[problem], strict=True))
            store.add(Outcome(Row(**row, **_columns(outcome))))
        store.end("complete")
    return folder


def _columns(outcome):
    if isinstance(outcome[0], str):
        kind, detail, *witness = outcome
        failure = {"failure_kind": kind, "failure_detail": detail, "witness": witness[0] if witness else None}
        return {"plan_time": 0.1, **failure}
    plan_time, duration = outcome
    ladder = {"planned": True, "timed": True, "verified": True}
    return {**ladder, "plan_time": plan_time, "duration": duration, "lower_bound": 0.5}
