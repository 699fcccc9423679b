"""`clearance` of a problem file: as in Python, and what is wrong with it in words, with its line."""

import pytest

import optiplan as op

FILE = """\
version: 1
robot: panda
start: {configuration: ready}
goal: {joints: [0.5, -0.6, 0.2, -2.2, 0.1, 1.7, 0.6]}
scene:
  obstacles:
    - {name: table, shape: {box: [0.8, 0.8, 0.05]}, pose: {position: [0.6, 0, 0.1]}}
  allowed_collisions: [[table, panda_link0]]
"""


def loaded(tmp_path, clearance):
    file = tmp_path / "problem.yaml"
    file.write_text(FILE + clearance)
    return op.load_problem(file)


def test_a_file_and_python_say_the_same(tmp_path):
    text = "clearance: {scene: 0.005, self: 0.002, pairs: [{of: 'panda_*finger', from: [table], at_least: 0.01}]}\n"
    problem = loaded(tmp_path, text)
    pairs = (op.SafePairs(("panda_*finger",), ("table",), 0.01),)
    safety = op.Safety(0.005, own=0.002, pairs=pairs)
    assert problem.scene.safety.same_as(safety)
    same = loaded(tmp_path, "").with_parts(clearance=safety)
    assert same.scene.safety.same_as(safety)
    assert same.with_scene(op.Scene(problem.scene.obstacles, safety=0.01)).scene.safety.own == 0.01
    assert same.with_seed(3).with_start(problem.start).scene.safety.same_as(safety)


def test_it_is_part_of_what_a_problem_is(tmp_path):
    without, asked = loaded(tmp_path, ""), loaded(tmp_path, "clearance: 0.005\n")
    assert without.scene.safety is None
    assert "clearance" not in without.source
    assert loaded(tmp_path, "clearance: 0\n").scene.safety is None
    assert asked.hash != without.hash
    again = tmp_path / "again.yaml"
    asked.save(again)
    assert op.load_problem(again).hash == asked.hash


def test_a_scene_that_asks_nothing_is_said_to_and_wishes_nothing(tmp_path):
    problem = loaded(tmp_path, "clearance: 0.005\n")
    none = problem.with_scene(op.Scene(problem.scene.obstacles, safety=0))
    assert (none.scene.safety, none.wished_clearance, none.source["clearance"]) == (None, 0.0, 0.0)
    stated = loaded(tmp_path, "clearance: 0\n").scene
    assert op.Problem("panda", "ready", "extended", scene=stated).wished_clearance == 0.0
    assert not loaded(tmp_path, "clearance: 0.005\n").scene.unwished
    made = op.Problem(
        "panda", "ready", "extended", scene=op.Scene(safety=0).with_(op.Sphere("ball", 0.1, position=(2, 0, 0)))
    )
    assert made.wished_clearance == 0.0
    assert op.Problem("panda", "ready", "extended", scene=op.Scene()).wished_clearance > 0.0


@pytest.mark.parametrize(
    ("clearance", "words"),
    [
        ("clearance: -0.005", "problem.yaml:9: clearance: -0.005; expected a number ≥ 0"),
        ("clearance: 5", "problem.yaml:9: clearance: 5; expected a number ≤ 1"),
        ("clearance: {scene: 0.01, within: 0}", "clearance.within: 0; expected a number ≥ 0.001"),
        ("clearance: {links: 0.01}", "clearance.links: unknown key 'links'"),
        (
            "clearance:\n  scene: 0.005\n  pairs:\n    - {of: 'panda_*', from: tabel, at_least: 0.01}",
            "problem.yaml:12: clearance.pairs[0].from: 'tabel', which no body is called; expected one of:",
        ),
        (
            "clearance: {pairs: [{of: table, from: [table], at_least: 0.01}]}",
            "clearance.pairs[0]: one body in both groups, and no other; expected two bodies",
        ),
        (
            "clearance: {pairs: [{of: table, from: panda_link0, at_least: 0.01}]}",
            "clearance.pairs[0]: pairs that are not checked (allowed by scene.allowed_collisions); "
            "expected pairs that are checked",
        ),
        (
            "clearance: {pairs: [{of: panda_link3, from: panda_link4, at_least: 0.01}]}",
            "clearance.pairs[0]: pairs that are not checked (adjacent); expected pairs that are checked",
        ),
        (
            "  attached: [{name: part, shape: {sphere: 0.01}, link: panda_hand, touch: [panda_leftfinger]}]\n"
            "clearance: {pairs: [{of: part, from: [panda_hand, panda_leftfinger], at_least: 0.01}]}",
            "clearance.pairs[0]: pairs that are not checked (held, with what it may touch); expected",
        ),
    ],
)
def test_what_cannot_be_asked_is_told_with_its_line(tmp_path, clearance, words):
    with pytest.raises(op.InputError) as error:
        loaded(tmp_path, clearance + "\n")
    assert words in str(error.value)


TOOL = """\
tools:
  pen:
    link: panda_hand
    tcp: {position: [0, 0, 0.2]}
    shapes:
      - {shape: {sphere: 0.01}, pose: {position: [0, 0, 0.1]}}
      - {name: cap, shape: {sphere: 0.01}, pose: {position: [0, 0, 0.2]}}
clearance: {pairs: [{of: pen, from: [table, cap], at_least: 0.01}]}
"""


def test_bodies_of_tools_have_names_of_a_clearance(tmp_path):
    assert loaded(tmp_path, TOOL).scene.safety.asked("pen", "table", obstacle=True) == 0.01
    words = r"'pne', which no body is called; expected one of: cap, .*did you mean 'pen'"
    with pytest.raises(op.InputError, match=words):
        loaded(tmp_path, TOOL.replace("of: pen", "of: pne"))


def test_a_link_and_an_obstacle_that_both_stand_are_a_pair_in_a_task_alone():
    cup = op.Box("cup", size=(0.05, 0.05, 0.05), position=(0.5, 0, 0.025))
    asked = op.Safety(pairs=(op.SafePairs(("cup",), ("panda_link0",), 0.01),))
    scene = op.Scene([cup], safety=asked)
    with pytest.raises(op.InputError, match=r"pairs that are not checked \(neither ever moves\)"):
        op.Problem("panda", "ready", "extended", scene=scene)
    in_task = op.Problem("panda", "ready", scene=scene, task=op.Task().move("extended"))
    assert in_task.safety.pairs == asked.pairs
