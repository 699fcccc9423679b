"""Steps that go with what moves, waits and alternatives in a file: what they become, what is refused with its line."""

from pathlib import Path

import numpy as np
import pytest

import optiplan as op
from optiplan.config.document import parse_yaml
from optiplan.errors import InputError
from optiplan.problem.from_data import read_problem
from optiplan.problem.load import problem_from_dict
from optiplan.problem.problem import Problem
from optiplan.problem.schema.picks import with_picks
from optiplan.problem.task.rides import Mover, WaitUntil
from optiplan.problem.task.steps import Detach, StraightLine
from tests.robot.robots import LIMIT, LINK, joint, write_robot

FILE = """\
version: 1
robot: panda
start: {configuration: ready}
frames:
  belt: {position: [0.5, -0.6, 0.1], rpy: [0, 0, 1.5708], motion: {polynomial: [[0], [0, 0.3], [0]]}}
  table: {position: [0.4, 0.4, 0.1], motion: {turn: {axis: [0, 0, 1], angle: [0, 0.5]}}}
scene:
  obstacles:
    - {name: cube, shape: {box: [0.04, 0.04, 0.06]}, pose: {in: belt, position: [0.1, 0, 0.04]}}
    - {name: stone, shape: {sphere: 0.02}, pose: {position: [0.3, -0.5, 0.02]}}
task:
  - wait_until: belt.y > -0.3
  - pick: {object: cube, from: belt, mass: 0.2}
  - line: {by: [0.05, 0, 0], in: belt}
  - place: {object: cube, pose: {in: table, position: [0.1, 0, 0.05], rpy_deg: [180, 0, 0]}}
  - move: {configuration: ready}
"""


def read(text):
    return Problem.of(read_problem(parse_yaml(text, Path("cell.yaml")), Path()))


def wrong(old, new):
    assert old in FILE
    with pytest.raises(InputError) as error:
        read(FILE.replace(old, new))
    return [f"{issue.line}: {issue.field}: {issue.found}; {issue.expected}" for issue in error.value.issues]


def test_what_is_in_a_moving_frame_moves_with_it():
    cube, stone = read(FILE).scene.obstacles
    np.testing.assert_allclose(cube.X_WO.translation, [0.5, -0.5, 0.14], atol=1e-5)
    np.testing.assert_allclose(cube.motion.pose(2.0).translation, [0, 0.6, 0])
    assert stone.motion is None


def test_picks_and_places_are_steps_with_their_rides():
    problem = read(FILE)
    kinds = [(step.number, step.kind, step.ride and step.ride.mover.name) for step in problem.task]
    assert kinds == [
        (1, "wait_until", None),
        *[(2, "approach", "cube")] * 2,
        (3, "attach", "cube"),
        (4, "gripper", "cube"),
        (5, "retreat", "cube"),
        (6, "line", "cube"),
        *[(7, "approach", "table")] * 2,
        (8, "gripper", "table"),
        (9, "detach", "table"),
        (10, "retreat", "table"),
        (11, "move", None),
    ]
    attach, gripper = problem.task[3].action, problem.task[4].action
    assert (attach.link, attach.mass) == ("panda_hand", 0.2)
    assert attach.touch == {"panda_leftfinger", "panda_rightfinger"}
    assert gripper.goal[0].q == pytest.approx([0.02])  # 0.04 m wide, two fingers
    assert len(problem.task[1].action.goal) == len(problem.task[2].action.ends) > 4
    line, release = problem.task[6].action, problem.task[10].action
    assert isinstance(line, StraightLine)
    np.testing.assert_allclose(line.by, [0, 0.05, 0], atol=1e-6)  # along x of the belt
    assert isinstance(release, Detach)
    assert release.mover.name == "table"
    again = problem_from_dict(problem.source)
    assert again.hash == problem.hash


@pytest.mark.parametrize("of", [{"arm": "right"}, {"group": "right"}])
def test_an_arm_takes_objects_with_its_own_hand(of):
    arms = op.Robot.side_by_side({"left": "panda", "right": {"use": "panda", "base": op.Pose((0, -1, 0))}})
    cube = op.Box("cube", size=(0.04, 0.04, 0.04), position=(0.5, -1, 0.02))
    higher, slow = op.Pose((0.5, -1, 0.2), rpy=(np.pi, 0, 0)), {"tool_speed": {"linear": 0.2}}
    own = {"hand": "right/hand", "path_constraints": [slow], **of}
    task = op.Task().pick("cube", **own).place("cube", higher, **own)
    problem = op.Problem(arms, "ready", task=task, scene=[cube])
    attach = next(step.action for step in problem.task if step.kind == "attach")
    assert attach.link == "right/panda_hand"
    assert attach.touch == {"right/panda_leftfinger", "right/panda_rightfinger"}
    lines = [step.action for step in problem.task if isinstance(step.action, StraightLine)]
    limits = [(step.kind, one) for step in problem.task for one in step.constraints]
    assert {kind for kind, _ in limits} == {"approach", "gripper", "retreat"}
    assert {one.frame for one in (*lines, *(one for _, one in limits))} == {"right/panda_hand_tcp"}
    assert {step.arm for step in problem.task} == {of.get("arm", "")}
    still = {"arm": "right", "path_constraints": [slow]}
    steps = op.Task().gripper("right/hand", [0.02], **still).dwell(0.1, **still)
    assert {step.constraints[0].frame for step in problem.with_task(steps).task} == {"right/panda_hand_tcp"}


def test_a_problem_with_a_tool_takes_up_a_pick():
    """The tool frame of the problem is the tool, which its robot without the tool does not have."""
    pen = op.Tool("pen", link="panda_hand", tcp=op.Pose((0, 0, 0.2)))
    cube = op.Box("cube", size=(0.04, 0.04, 0.04), position=(0.5, 0, 0.02))
    problem = op.Problem("panda", "ready", scene=[cube], tool=pen, task=op.Task().gripper("hand", [0.04]))
    again = problem.with_task(op.Task().pick("cube"))
    assert [step.action.link for step in again.task if step.kind == "attach"] == ["panda_hand"]
    assert again.robot.tool_frame == "pen"


def test_fingers_close_by_what_each_slides(tmp_path):
    """One by q, one by 2 q, and one that follows that: 4 q in all."""
    follower = LIMIT + '<mimic joint="{}" multiplier="{}"/>'
    parts = [*(LINK.format(name) for name in "abcde"), joint("j", "a", "b"), joint("f", "b", "c", "prismatic")]
    parts += [joint("g", "b", "d", "prismatic", follower.format("f", 2))]
    parts += [joint("h", "b", "e", "prismatic", follower.format("g", -0.5))]
    robot = op.load_robot(write_robot(tmp_path, parts, "groups: {arm: [j], hand: [f]}\ntool_frame: b\n"))
    text = "scene: {obstacles: [{name: cube, shape: {box: [0.4, 0.4, 0.5]}}]}\n"
    text += "task: [{pick: {object: cube, grasps: [{position: [0, 0, 0]}]}}]\n"
    document, issues = with_picks(parse_yaml(text, Path("p.yaml")), lambda: (robot, robot.joint_names))
    assert issues == []
    attach, gripper = document.data["task"][1:3]
    assert gripper["gripper"]["joints"] == [0.1]
    assert attach["attach"]["touch"] == ["c", "d", "e"]


def test_python_states_the_same_steps():
    belt = {"position": [0.5, -0.6, 0.1], "motion": {"polynomial": [[0], [0, 0.3], [0]]}}
    cube = op.Box("cube", size=(0.04,) * 3, position=(0.5, -0.5, 0.14)).moving([[0], [0, 0.3], [0]])
    one, other = op.Task().dwell(0.1), op.Task().dwell(0.2)
    task = op.Task().wait_until("belt.y > -0.3").pick("cube", from_="belt").move("ready").either(one, other)
    problem = op.Problem("panda", "ready", task=task.move("ready"), scene=[cube], frames={"belt": belt})
    assert [step.kind for step in problem.task][:3] == ["wait_until", "approach", "approach"]
    assert [step.option for step in problem.task][-3:] == [(0, 0), (0, 1), None]
    assert str(task) == "Task: wait_until, pick cube, move, either of 2"
    down = op.Pose((0.5, -0.5, 0.14), rpy_deg=(180, 0, 0))
    rides = op.Task().approach(down, 0.1, rides="cube").retreat(0.1).move("ready")
    assert op.Problem("panda", "ready", task=rides, scene=[cube]).task[0].ride.mover.name == "cube"
    for call in (
        lambda: op.Task().either(one),
        lambda: op.Task().either(one, op.Task()),
        lambda: op.Task().pick("a", b=1),
        lambda: op.Task().pick("a", path_constraints=3),
        lambda: op.Task().pick("a", grasps=3),
        lambda: op.Task().pick(3),
        lambda: op.Task().place("a", 3),
        lambda: op.Task().wait_until(3),
    ):
        with pytest.raises(InputError):
            call()


def test_path_constraints_of_picks_and_places_hold_in_their_motions():
    cube, slow = op.Box("cube", size=(0.04,) * 3, position=(0.5, 0, 0.02)), op.ToolSpeed("panda_hand", linear=0.2)
    task = op.Task().pick("cube", path_constraints=[slow], name="take")
    task = task.place("cube", op.Pose((0.5, 0.2, 0.02), rpy=(np.pi, 0, 0)), path_constraints=[slow])
    steps = op.Problem("panda", "ready", task=task, scene=[cube]).task
    assert {step.kind: len(step.constraints) for step in steps} == {
        **dict.fromkeys(("approach", "gripper", "retreat"), 1),
        **dict.fromkeys(("attach", "detach"), 0),
    }
    assert [step.name for step in steps].count("take") == 2  # the two motions of the approach
    later = {"tool_speed": {"linear": 0.2, "during": [0.5, 1.0]}}
    with pytest.raises(InputError, match="no `during`: the whole step"):
        op.Problem("panda", "ready", task=op.Task().pick("cube", path_constraints=[later]), scene=[cube])
    data = [{"pick": {"object": "cube"}, "path_constraint": [later]}]
    with pytest.raises(InputError, match="did you mean 'path_constraints'") as caught:
        op.Problem("panda", "ready", task=data, scene=[cube])
    assert "option" not in str(caught.value)


def test_path_constraints_on_the_object_hold_while_it_is_held():
    level = "orientation: {frame: cube, axis: [0, 0, 1], toward: [0, 0, 1], within: 0.2}"
    kept = f"\n    path_constraints:\n      - {level}\n      - tool_speed: {{linear: 1}}\n"
    text = FILE.replace("mass: 0.2}\n", "mass: 0.2}" + kept).replace("[180, 0, 0]}}\n", "[180, 0, 0]}}" + kept)
    found = [tuple(one.KEY for one in step.constraints) for step in read(text).task]
    slow, both = ("tool_speed",), ("orientation", "tool_speed")
    pick, place = [slow, slow, (), both, both], [both, both, both, (), slow]
    assert found == [(), *pick, (), *place, ()]
    with pytest.raises(InputError) as error:
        read(text.replace("tool_speed: {linear", "tool_speed: {frame: nose, linear"))
    assert {(issue.line, issue.found) for issue in error.value.issues} == {
        (k, "unknown frame 'nose'") for k in (16, 21)
    }


def test_steps_of_python_take_an_arm():
    keys = {"name": "x", "arm": "left", "wait_for": "other", "allowed_collisions": [["a", "b"]]}
    task = (
        op.Task()
        .pick("cube", **keys)
        .place("cube", op.Pose((0.5, 0, 0.1)), **keys)
        .tour([op.Pose((0.5, 0, 0.1))], **keys)
    )
    for step in task.path([[0.5, 0, 0.1], [0.5, 0.1, 0.1]], 0.1, **keys).steps:
        assert {key: step[key] for key in keys} == keys


def test_an_obstacle_of_python_turns():
    disc = op.Cylinder("disc", radius=0.1, length=0.02, position=(0.5, 0, 0.1))
    turning = disc.moving(turn={"axis": (0, 0, 2), "angle": (0, 1.0)})
    assert turning.motion.to_data()["turn"] == {"axis": [0, 0, 1], "angle": [0, 1.0], "about": [0.5, 0, 0.1]}
    for turn in (
        {},
        {"axis": (0, 0, 0), "angle": (1,)},
        {"axis": (0, 0, 1), "angle": ()},
        {"axis": (0, 1), "angle": (1,)},
        3,
    ):
        with pytest.raises(InputError):
            disc.moving(turn=turn)


REFUSED = {
    "unknown mover": ("in: table, pos", "in: tabel, pos", 15, "tabel"),
    "not along": (
        "in: belt}\n  - place",
        "in: table}\n  - place",
        14,
        "which moves, while the arm does not go with it",
    ),
    "never": ("belt.y > -0.3", "belt.x > 3", 12, "never comes true"),
    "no condition": ("belt.y > -0.3", "belt.y", 12, "NAME.x > NUMBER"),
    "no angle": ("belt.y > -0.3", "belt.angle > 1", 12, "does not turn"),
    "unknown in a condition": ("belt.y > -0.3", "bet.y > 1", 12, "belt"),
    "rides to the end": ("  - move: {configuration: ready}\n", "", 15, "comes to rest"),
    "no motion": ("motion: {turn: {axis: [0, 0, 1], angle: [0, 0.5]}}", "motion: {}", 6, "neither polynomial nor turn"),
    "standing object": ("object: cube, from", "object: stone, from", 13, "stone"),
    "too wide": ("box: [0.04, 0.04, 0.06]", "box: [0.1, 0.1, 0.1]", 13, "the fingers open to 0.08 m"),
    "unknown step": ("  - move: {configuration: ready}", "  - pik: {object: cube}", 16, "(did you mean 'pick'?)"),
    "unknown key of a pick": ("from: belt, mass", "form: belt, mass", 13, "form"),
    "a region without end": (
        "move: {configuration: ready}",
        "move: {region: {in: belt, position: [0, 0, 0.2], rpy_deg: [180, 0, 0], along: {y: free}}}",
        16,
        "move.region.along: a region with no bound along y",
    ),
    "no fingers": ("object: cube, from", "object: cube, hand: arm, from", 13, "group of fingers"),
    "a line in the world": ("by: [0.05, 0, 0], in: belt", "pose: {position: [0.5, 0, 0.3]}", 14, "a pose in the world"),
    "a direction in the world": (
        "  - move: {configuration: ready}",
        "  - line: {by: [0.05, 0, 0.05]}\n  - move: {configuration: ready}",
        16,
        "a direction in the world while the arm goes with 'table', which turns",
    ),
    "motion in motion": ("{position: [0.4, 0.4, 0.1], motion", "{in: belt, motion", 6, "a motion in 'belt'"),
    "a base that moves": ("start:", "base: {in: belt}\nstart:", 3, "which moves"),
}


@pytest.mark.parametrize(("old", "new", "line", "words"), REFUSED.values(), ids=REFUSED)
def test_what_does_not_fit_is_refused_with_its_line(old, new, line, words):
    found = wrong(old, new)
    assert any(one.startswith(f"{line}: ") and words in one for one in found), found


def test_a_direction_in_the_world_along_the_axis_of_a_turn_is_one_in_what_turns():
    end = "  - move: {configuration: ready}"
    line = read(FILE.replace(end, f"  - line: {{by: [0, 0, 0.05]}}\n{end}")).task[-2]
    assert line.ride.mover.name == "table"
    assert line.action.by.tolist() == [0.0, 0.0, 0.05]


def test_alternatives_end_alike():
    either = "  - either:\n      - [{dwell: 0.1}]\n      - [{detach: {object: cube}}]\n  - place"
    assert "end otherwise" in wrong("  - place", either)[0]
    assert "two or more lists" in wrong("  - place", "  - either: [[{dwell: 0.1}]]\n  - place")[0]
    inner = "  - either: [[{dwell: 0.1}], [{either: [[{dwell: 0.1}], [{dwell: 0.2}]]}]]\n  - place"
    assert "within alternatives" in wrong("  - place", inner)[0]
    many = "  - either: [[{dwell: 0.1}], [{dwell: 0.2}]]\n" * 6
    assert "64 tasks" in wrong("  - place", many + "  - place")[0]


def test_a_grid_of_a_million_steps_is_refused():
    grid = "  - for: {i: 0..999, j: 0..999}\n    steps: [{dwell: 0.1}]\n  - place"
    assert wrong("  - place", grid)[0].startswith("15: task[3].for: 1000000 steps")


@pytest.mark.parametrize(("relation", "value", "first"), [(">", 0.3, 1.0), ("<", 0.3, 0.0), (">=", -1.0, 0.0)])
def test_the_first_time_of_a_condition(relation, value, first):
    belt = read(FILE).scene.obstacles[0]
    wait = WaitUntil(Mover("belt", belt.motion, belt.X_WO), "y", relation, value - 0.5)
    assert wait.first(0.0) == pytest.approx(first, abs=1e-9)
    assert wait.holds(wait.first(0.0))
