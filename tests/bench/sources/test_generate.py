import numpy as np
import pytest

from optiplan.bench.sources import generate
from optiplan.bench.sources.generate import GENERATORS, LEVELS
from optiplan.bench.sources.tabletop_scenes import Arm, pointing
from optiplan.bench.suite.suite import load_suite
from optiplan.collision.model import CollisionModel
from optiplan.errors import InputError
from optiplan.problem.goals import goal_configurations
from optiplan.problem.load import problem_from_dict


@pytest.fixture
def load(tmp_path):
    def load(source):
        path = tmp_path / "suite.yaml"
        path.write_text(f"version: 1\nname: mine\nbudget: 1\nproblems: [{source}]\nplanners: [quintic]\n")
        return load_suite(path, tmp_path / "scratch").problems

    return load


@pytest.mark.parametrize("name", sorted(GENERATORS))
def test_the_robot_can_stand_at_both_ends(load, name):
    (item,) = load(f"{{generate: {name}, params: {{level: easy}}}}")
    assert (item.id, item.set_name, item.difficulty) == (f"{name}/easy-0000", name, "easy")
    problem = problem_from_dict(item.data)
    model = CollisionModel(problem.robot, problem.scene)
    assert problem.scene.obstacles
    assert not model.collides(problem.start)
    assert goal_configurations(problem, model, np.random.default_rng(1)).configurations


def test_a_problem_depends_on_seed_and_index_alone(load):
    several = load("{generate: table, count: 3, seed: 7}")
    assert [item.data for item in load("{generate: table, count: 2, seed: 7}")] == [p.data for p in several[:2]]
    assert several[0].data["scene"] != several[1].data["scene"]
    (other,) = load("{generate: table, seed: 8}")
    assert other.data["scene"] != several[0].data["scene"]


def test_a_scene_is_drawn_once(load, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    (first,) = load("{generate: table}")
    monkeypatch.setattr(generate, "_problem", lambda *parts: None)  # nothing can be drawn any more
    (again,) = load("{generate: table}")
    assert again == first
    for other in ("seed: 1", "robot: ur3", "params: {objects: 1}"):
        with pytest.raises(InputError, match="cannot stand"):
            load(f"{{generate: table, {other}}}")


def test_levels_and_parameters_change_the_scene(load):
    sizes = [
        len(load(f"{{generate: clutter, params: {{level: {level}}}}}")[0].data["scene"]["obstacles"])
        for level in LEVELS
    ]
    assert sizes == [8, 20, 40]
    (item,) = load("{generate: clutter, params: {bodies: 3, level: hard}}")
    assert len(item.data["scene"]["obstacles"]) == 3
    assert item.difficulty == "hard"


def test_scenes_follow_the_arm(load):
    (panda,), (ur3,) = load("{generate: table}"), load("{generate: table, robot: ur3}")
    assert ur3.data["robot"] == "ur3"
    sides = [item.data["scene"]["obstacles"][0]["shape"]["box"][0] for item in (panda, ur3)]
    assert sides[1] < 0.8 * sides[0]


@pytest.mark.parametrize(
    ("source", "found"),
    [
        ("{generate: shelv}", "unknown generator 'shelv'"),
        ("{generate: shelf, params: {level: extreme}}", "level 'extreme'"),
        ("{generate: shelf, params: {gpa: 0.3}}", "unknown parameter 'gpa'"),
        ("{generate: shelf, params: {rows: 2.5}}", "rows = 2.5"),
        ("{generate: shelf, params: {gap: wide}}", "gap = 'wide'"),
        ("{generate: shelf, params: {gap: -1}}", "gap = -1"),
    ],
)
def test_what_does_not_fit_is_told_with_its_line(load, source, found):
    with pytest.raises(InputError) as caught:
        load(source)
    (issue,) = caught.value.issues
    assert issue.found == found
    assert issue.line == 4


def test_scenes_in_which_the_robot_cannot_stand_are_told(load, monkeypatch):
    monkeypatch.setattr(generate, "_DRAWS", 2)
    with pytest.raises(InputError, match="2 scenes in which 'panda' cannot stand"):
        load("{generate: slot, params: {width: 0.02}}")


@pytest.mark.parametrize("approach", [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.6, -0.8, 0.0]])
def test_a_tool_points_along_its_approach(approach):
    X_WT = pointing(np.array([0.1, 0.2, 0.3]), np.array(approach), 0.7)
    assert np.allclose(X_WT.rotation[:, 2], approach)
    assert np.allclose(X_WT.rotation @ X_WT.rotation.T, np.eye(3))
    assert np.isclose(np.linalg.det(X_WT.rotation), 1.0)


def test_shares_of_the_reach():
    assert np.allclose(Arm(np.array([0.0, 0.1, 0.3]), 2.0).at(0.5, -0.25, 0.1), [1.0, -0.4, 0.5])
