"""Steps of a task that a file writes once."""

from pathlib import Path

import pytest
from ruamel.yaml import YAML

from optiplan.config.document import parse_yaml
from optiplan.errors import InputError
from optiplan.problem.from_data import read_problem
from optiplan.problem.load import problem_from_dict
from optiplan.problem.schema.problem import problem_schema

GRID = """\
version: 1
name: grid
robot: panda
start: {configuration: ready}
task:
  - for: {i: 0..1, j: [0, 2]}
    steps:
      - {move: {pose: {position: ["=0.4 + 0.08 * i", "=-0.1 * j", 0.4], rpy: ["=pi", 0, 0]}}, name: "over {i}{j}"}
      - do: dip
        with: {depth: "=0.02 * (i + 1)"}
  - for: {side: [panda_hand]}
    steps:
      - attach: {object: cube, link: "{side}"}
tasks:
  dip:
    - line: {by: [0, 0, "=-depth"]}
    - line: {by: [0, 0, "=depth"]}
scene:
  obstacles:
    - {name: cube, shape: {box: [0.04, 0.04, 0.04]}, pose: {position: [0.3, 0.5, 0.02]}}
"""


def test_every_value_goes_with_every_other_and_the_last_changes_first():
    found = problem_from_dict(YAML(typ="safe").load(GRID))
    steps = found.source["task"]
    assert [one["name"] for one in steps if "move" in one] == ["over 00", "over 02", "over 10", "over 12"]
    positions = [one["move"]["pose"]["position"] for one in steps if "move" in one]
    assert positions[1] == pytest.approx([0.4, -0.2, 0.4])
    assert positions[2] == pytest.approx([0.48, 0.0, 0.4])
    assert [one["line"]["by"][2] for one in steps if "line" in one][::2] == pytest.approx([-0.02, -0.02, -0.04, -0.04])
    assert steps[-1]["attach"]["link"] == "panda_hand"
    assert "tasks" not in found.source
    assert problem_from_dict(found.source).hash == found.hash


SAME = "=0.05 * 2", 0.1


def test_a_task_without_loops_may_compute():
    """Names are none of that: `=M1` is one of a plant."""
    lines = [{"line": {"by": [0, 0, said]}, "name": "=M1", "allowed_collisions": [["=M2", "cube"]]} for said in SAME]
    data = {**YAML(typ="safe").load(GRID), "task": lines}
    del data["tasks"]
    data["scene"]["obstacles"] += [{**data["scene"]["obstacles"][0], "name": "=M2", "pose": {"position": [0, 9, 0]}}]
    found = problem_from_dict(data).source["task"]
    assert [one["line"]["by"] for one in found] == [[0, 0, 0.1]] * 2
    assert [(one["name"], one["allowed_collisions"]) for one in found] == [("=M1", [["=M2", "cube"]])] * 2
    given = [{"for": {"to": ["=0.05 * 2"]}, "steps": [{"line": {"by": [0, 0, "=to"]}}]}]
    assert problem_from_dict({**data, "task": given}).source["task"][0]["line"]["by"] == [0, 0, 0.1]
    near = {"line": {"from": [0, 0, "=0.1 * 2"], "to": [1, 0, "=0.2"], "within": 5.0}}
    kept = problem_from_dict({**data, "task": [{**lines[1], "path_constraints": [near]}]}).source["task"]
    assert kept[0]["path_constraints"][0]["line"]["from"] == [0, 0, 0.2]
    plain = problem_from_dict({**data, "task": lines[1:]}).source["task"]
    assert plain == found[1:]


def wrong(old, new):
    """The issues of the grid with a text in place of another, each as line and words."""
    assert old in GRID
    with pytest.raises(InputError) as refused:
        read_problem(parse_yaml(GRID.replace(old, new), Path("grid.yaml")), Path())
    return [(issue.line, str(issue)) for issue in refused.value.issues]


@pytest.mark.parametrize(
    ("old", "new", "line", "words"),
    [
        ("i: 0..1", "i: 0..1000000", 6, "at most 10000"),
        ("i: 0..1, j: [0, 2]", "i: 0..999, j: 0..3", 16, "more steps than that"),
        ("i: 0..1", "i: a..b", 6, "a range such as 0..3"),
        ("{i: 0..1, j: [0, 2]}", "7", 6, "values by name"),
        ("    steps:\n      - {move", "    step:\n      - {move", 7, "did you mean 'steps'"),
        ("do: dip", "do: dipp", 9, "did you mean 'dip'"),
        ('{depth: "=0.02 * (i + 1)"}', "3", 10, "values by name, such as {height: 0.2}"),
        ('"=-depth"', '"=-dept"', 16, "did you mean 'depth'"),
        ('"=-depth"', '"=depth.real"', 16, "an expression such as"),
        ('"=-depth"', '"=1 / 0"', 16, "an expression such as"),
        ('- line: {by: [0, 0, "=depth"]}', "- do: dip", 17, "a circle of tasks: dip does dip"),
        ("  dip:\n    - line", "  dip: 3\n  dop:\n    - line", 15, "a list of steps"),
        ('position: ["=0.4', 'positions: ["=0.4', 8, "did you mean 'position'"),
        ('link: "{side}"', 'link: "{sides}"', 13, "{sides}"),
    ],
)
def test_what_is_wrong_is_told_with_its_line(old, new, line, words):
    found = wrong(old, new)
    assert any(at == line and words in said for at, said in found), found


@pytest.mark.parametrize("deep", [20, 21])
def test_tasks_that_do_each_other_all_count_or_are_refused(deep):
    tasks = {f"t{k}": [{"dwell": 0.1}, {"do": f"t{k + 1}"}] for k in range(1, deep)} | {f"t{deep}": [{"dwell": 0.1}]}
    data = {**YAML(typ="safe").load(GRID), "task": [{"do": "t1"}], "tasks": tasks}
    if deep == 20:
        assert len(problem_from_dict(data).task) == 20
        return
    with pytest.raises(InputError, match=r"tasks.t21\[0\]: tasks that do tasks, 21 deep; expected at most 20"):
        problem_from_dict(data)


def test_editors_know_the_keys():
    schema = problem_schema()
    assert "tasks" in schema["properties"]
    assert {"for", "steps", "do", "with"} <= set(schema["$defs"]["TaskStepSpec"]["properties"])
