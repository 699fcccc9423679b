"""`optiplan place`: the table, JSON, files, and a task that no base allows."""

import re

import numpy as np
import pytest

import optiplan as op
from optiplan.api.studies import placing
from optiplan.api.studies.placing import RESULT, _with_robot
from optiplan.planners.tours.placing import PlaceScores

TASK = """version: 1
name: three
robot: ur5
start: {configuration: ready}
goal: {pose: {position: [0.45, 0.2, 0.3], rpy: [3.1416, 0, 0]}}
"""
FEW = ("--x", "0.1", "--y", "0.1", "--yaw", "0", "--points", "2", "--budget", "4")


@pytest.fixture
def task(tmp_path):
    (tmp_path / "three.yaml").write_text(TASK)
    return tmp_path / "three.yaml"


def test_a_base_is_found_and_written(optiplan, task, tmp_path):
    code, out, _ = optiplan("place", "ur5", str(task), *FEW, "--out", str(tmp_path / "place"))
    assert code == 0
    assert re.search(r"base moved by x -?[\d.]+ m, .*: [\d.]+ s; at the given one: [\d.]+ s", out)
    assert {path.name for path in (tmp_path / "place").iterdir()} == {"place.html", "place.png", "problem.yaml"}
    page = (tmp_path / "place" / "place.html").read_text()
    assert "data:image/png;base64," in page
    assert "base:" in page
    assert 'name="viewport"' in page
    assert re.search('<div class="scrolled"[^>]*><table>', page)  # a narrow page is not as wide as the table
    found, given = (float(x) for x in re.findall(r": ([\d.]+) s", out)[-2:])
    assert found <= given
    assert optiplan("check", str(tmp_path / "place" / "problem.yaml"))[0] == 0


def test_json_of_a_task_out_of_reach(optiplan_json, task, tmp_path):
    task.write_text(TASK.replace("0.45, 0.2", "4.5, 0.2"))
    RESULT.write(tmp_path, {"place.html": b"a page", "problem.yaml": b"of an earlier result"})
    code, data = optiplan_json("place", "puma560", str(task), *FEW, "--out", str(tmp_path))
    assert code == data["exit_code"] == 3
    assert data["robot"] == "puma560"  # another one than the task's
    assert data["files"] == [str(tmp_path / name) for name in ("place.png", "place.html")]
    assert not (tmp_path / "problem.yaml").exists()
    assert data["duration"] is None
    assert data["base"] is None
    assert data["scored"] >= 4
    assert data["unverified"][0]["moved"] == [0.0] * 4
    assert "goal" in data["unverified"][0]["why"]


@pytest.mark.parametrize("earlier", [{}, {"place.html": b"a page"}, {"place.html": b"a page", "problem.yaml": b"x"}])
def test_the_problem_itself_is_neither_replaced_nor_removed(optiplan, tmp_path, earlier):
    """Also where the folder has the page of an earlier result, or its `problem.yaml` was edited since."""
    if earlier:
        RESULT.write(tmp_path, earlier)
    (tmp_path / "problem.yaml").write_text(TASK)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    code, _, err = optiplan("place", "ur5", str(tmp_path / "problem.yaml"), *FEW, "--out", str(tmp_path))
    assert code == 2
    assert "problem.yaml: out: a file that no earlier result left there, or one of an older version, or that" in err
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_a_budget_that_the_map_uses_up_leaves_a_second_for_each_plan(optiplan_json, task):
    code, data = optiplan_json("place", "ur5", str(task), *FEW[:-2], "--budget", "0.1")
    assert code in (0, 3)
    assert data["planned"][0]["moved"] == [0.0] * 4


def test_a_table_says_why_a_place_is_refused(optiplan, task):
    task.write_text(TASK.replace("0.45, 0.2", "4.5, 0.2"))
    code, out, _ = optiplan("place", "ur5", str(task), *FEW)
    assert code == 3
    assert "not verified at x 0.000 m, y 0.000 m, z 0.000 m, yaw 0.000 rad: " in out


@pytest.mark.parametrize("robot", ["panda", "ur5"])
def test_several_robots_are_not_placed(optiplan, robot):
    code, _, err = optiplan("place", robot, "48_two_arms", *FEW)
    assert code == 2
    assert err.startswith("48_two_arms: problem: found several robots, each with a base of its own; expected one robot")


def test_another_robot_with_the_same_name_is_another():
    problem = op.load_problem("12_planar")
    urdf = problem.robot.source.parent / "planar2r.urdf"
    other = op.Robot.from_urdf(urdf, name=problem.robot.name, configurations={"ready": [0.1, 0.2]})
    assert _with_robot(problem, other).robot.fingerprint == other.fingerprint
    assert _with_robot(problem, problem.robot.name) is problem


def test_an_expression_and_the_seed_hold_at_every_base_and_are_in_no_file(tmp_path, monkeypatch):
    scores = PlaceScores(np.array([[0.0] * 4, [-0.2, -0.2, 0.0, 0.0]]), np.zeros(2), np.ones(2))
    monkeypatch.setattr(placing, "search_places", lambda *_: scores)
    plain = op.load_problem("12_planar", planner="quintic").with_seed(7)
    own = plain.with_constraint(op.Expression("slow", lambda k: k.v[0], lower=-9.0))
    stated = [(run.problem.seed, run.problem.path_constraints) for _, run in op.place(own).planned]
    assert stated == [(7, own.path_constraints)] * 2
    assert _with_robot(plain, "two_links").seed == 7
    for refused in ({"out": tmp_path}, {"robot": "two_links"}):
        with pytest.raises(op.InputError, match=r"op\.place: problem: found a problem with the expression 'slow'"):
            op.place(own, **refused)


def test_another_robot_starts_in_its_own_configuration(optiplan_json, task):
    asked, right = op.load_problem(task), np.pi / 2.0
    own = {"puma560": [0.0, right, -right, 0.0, 0.0, 0.0], "panda": [0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785]}
    for name, ready in own.items():
        stated = _with_robot(asked, name)
        assert (stated.robot.name, stated.start.tolist()) == (name, pytest.approx(ready))
        assert (stated.goal[0].X_WG.homogeneous == asked.goal[0].X_WG.homogeneous).all()
    assert optiplan_json("place", "nobody", str(task))[0] == 2
