"""The matrix of problems by planners: which run stands for a planner, its picture, where it leads."""

import json
import zlib

import numpy as np
import pytest

from optiplan.bench.report.analysis import analyse
from optiplan.bench.report.matrix import MOST_PROBLEMS, POINTS, chosen_problems, matrix_html, matrix_rows
from optiplan.bench.results.database import Store
from optiplan.kinematics.manipulability import ToolKinematics
from optiplan.robot.robot import load_robot
from optiplan.trajectory.trajectory import Trajectory

FAILED = ("collision", "the motion meets 'a <ball>'")


@pytest.fixture
def motion():
    robot = load_robot("planar2r")
    c = np.zeros((1, 2, 2))
    c[0, 0], c[0, 1] = [0.5, 1.0], [-1.0, 0.2]
    return robot, Trajectory(robot.joint_names, np.array([0.0, 1.0]), c)


@pytest.fixture
def store(results, motion):
    runs = {("s/a", "one", 0): FAILED, ("s/a", "one", 1): (1.0, 2.0), ("s/a", "two", 0): FAILED}
    runs["t/b", "one", 0] = (1.0, 1.0)
    with Store(results(runs), write=True) as store:
        data = zlib.compress(json.dumps(motion[1].to_dict()).encode())
        store._db.execute("INSERT INTO trajectories VALUES ('x', ?)", (data,))
        store._db.execute("UPDATE runs SET trajectory = 'x', metrics = '{\"clearance\": 0.003}' WHERE verified")
        yield store


def test_a_verified_run_stands_for_its_planner(store, motion):
    first, second = matrix_rows(store, analyse(store))
    assert (first.name, second.name) == ("s/a", "t/b")
    assert first.keys() == [("s/a", "one", 1, 0), ("s/a", "two", 0, 0)]
    assert first.verified == {"one": (1, 2), "two": (0, 1)}
    assert list(first.paths) == ["one"]
    robot, trajectory = motion
    tool = ToolKinematics(robot).evaluate(trajectory(np.array([0.0, 1.0])))[0][:, :3, 3]
    assert first.paths["one"].shape == (POINTS, 2)
    np.testing.assert_allclose(first.paths["one"][[0, -1]], first.picture.project(tool))


def test_cells_tell_and_lead_where_there_is_a_page(store):
    analysis = analyse(store)
    rows = matrix_rows(store, analysis)
    text = matrix_html(store, analysis, rows, {"s/a": "pages/a.html"}.get)
    assert text.count("<symbol") == 2
    assert 'href="pages/a.html#runs=one"' in text
    assert "a &lt;ball&gt;" in text
    assert "<ball>" not in text
    assert "clearance proved 3.00 mm" in text
    assert text.count("data-tip") == 3
    assert text.count("<td data-column=1 class=none>") == 1  # `two` was not tried on t/b
    folder = json.dumps(str(store.folder)).replace('"', "&quot;")
    assert f'data-actual="[{folder}, &quot;one&quot;, 1, 0]"' in text


def test_of_many_problems_those_on_which_planners_differ(results):
    runs = {}
    for k in range(MOST_PROBLEMS + 5):
        least = 1.0 if k else 9.0  # far from the bound, which says nothing of planners
        runs[f"s/{k:03d}", "one", 0] = (1.0, least)
        runs[f"s/{k:03d}", "two", 0] = FAILED if k >= MOST_PROBLEMS else (1.0, least + 0.01 * k)
    with Store(results(runs)) as store:
        found = chosen_problems(analyse(store))
    assert len(found) == MOST_PROBLEMS
    assert found == sorted(found)
    assert {f"s/{k:03d}" for k in range(MOST_PROBLEMS, MOST_PROBLEMS + 5)} <= set(found)
    assert "s/000" not in found  # the same motions
