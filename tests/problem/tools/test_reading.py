"""Tools of a problem file: what is read, what is refused, and where."""

import pickle

import numpy as np
import pinocchio as pin
import pytest
import yaml

import optiplan as op
from optiplan.errors import InputError
from optiplan.problem.load import load_problem
from optiplan.problem.task.steps import ChangeTool

TEXT = """\
version: 1
robot: planar2r
start: {joints: [1.0, 0.0]}
tool: probe
tools:
  probe:
    link: tip
    tcp: {position: [0.1, 0, 0]}
    shapes:
      - {shape: {box: [0.02, 0.02, 0.02]}, pose: {position: [0, 0, 0.1]}}
      - {name: bead, shape: {sphere: 0.01}, pose: {position: [0, 0, 0.2]}}
    touch: [forearm]
    mass: 0.5
  pen: {link: tip, tcp: {position: [0, 0, 0.1]}, parked: {position: [0, 0.9, 0]}}
task:
  - move: {joints: [0.5, 0]}
  - tool: none
  - move: {joints: [-1.0, 0]}
  - {tool: probe}
"""

BALL = {"shape": {"sphere": 0.01}}


@pytest.fixture(scope="module")
def problem(tmp_path_factory):
    file = tmp_path_factory.mktemp("tools") / "tools.yaml"
    file.write_text(TEXT)
    return load_problem(file)


def beside(name):
    """A scene with an obstacle of a name, far from the arm."""
    return {"obstacles": [{"name": name, **BALL, "pose": {"position": [9, 9, 9]}}]}


def refused(tmp_path, change):
    data = yaml.safe_load(TEXT)
    change(data)
    file = tmp_path / "case.yaml"
    file.write_text(yaml.safe_dump(data, sort_keys=False))
    with pytest.raises(InputError) as caught:
        load_problem(file)
    return caught.value.issues


def test_the_tcp_of_the_mounted_tool_is_the_tool_frame(problem):
    robot = problem.robot
    assert robot.tool_frame == "probe"
    q = np.array([0.3, -0.4])
    tip, tcp = (robot.fk(q, frame).matrix for frame in ("tip", "probe"))
    assert np.allclose(tip @ [0.1, 0, 0, 1], tcp[:, 3])
    assert op.load_robot("planar2r").tool_frame == "tool"  # the robot itself has no tool


def test_a_tool_fills_its_bodies_evenly(problem):
    """The whole mass by volume: 8e-6 m³ at 0.1 m and 4/3 pi 1e-6 m³ at 0.2 m."""
    volumes = np.array([8e-6, 4.0 / 3.0 * np.pi * 1e-6])
    weight = problem.tools[0].weight
    assert weight.mass == 0.5
    assert np.allclose(weight.lever, [0, 0, volumes @ [0.1, 0.2] / volumes.sum()])
    assert problem.robot.mounting.mass == 0.5


def test_what_a_data_sheet_says_of_a_tool_is_taken(problem):
    body = op.Box("block", size=(0.02, 0.02, 0.02), position=(0, 0, 0.1), rpy=(0.3, 0, 0))
    tool = op.Tool("probe", "tip", shapes=[body], mass=2.0, centre=(0.01, 0, 0.05), inertia=(0.02, 0.03, 0.04))
    weight = problem.with_parts(tools=[tool]).tools[0].weight
    assert np.allclose(weight.lever, [0.01, 0, 0.05])
    assert np.allclose(weight.inertia, np.diag([0.02, 0.03, 0.04]))


def test_torques_are_those_of_a_robot_built_with_the_tool(problem):
    """Of planar2r with the same inertia joined to its last joint by pinocchio itself."""
    robot, tool = problem.robot, problem.tools[0]
    other = op.load_robot("planar2r").model.copy()
    frame = other.frames[other.getFrameId("tip")]
    other.appendBodyToJoint(frame.parentJoint, tool.weight, frame.placement)
    rng = np.random.default_rng(0)
    q, v, a = rng.normal(size=(3, 2))
    ours, theirs, bare = (
        pin.rnea(model, model.createData(), q, v, a) for model in (robot.model, other, op.load_robot("planar2r").model)
    )
    assert np.allclose(ours, theirs)
    assert not np.allclose(ours, bare)


def test_a_step_changes_the_tool(problem):
    none, probe = (step.action for step in problem.task if isinstance(step.action, ChangeTool))
    assert (none.leaves.name, none.takes, probe.leaves, probe.takes.name) == ("probe", None, None, "probe")
    assert problem.scene.names == ("probe", "bead")  # the pen has no body


def test_file_python_and_copy_are_one_problem(problem, tmp_path):
    problem.save(tmp_path / "saved.yaml")
    assert load_problem(tmp_path / "saved.yaml").hash == problem.hash
    assert problem.with_scene(problem.scene).hash == problem.hash
    copied = pickle.loads(pickle.dumps(problem.robot))
    assert copied.tool_frame == "probe"
    assert np.allclose(copied.fk([0.1, 0.2]).position, problem.robot.fk([0.1, 0.2]).position)


def test_one_tool_may_be_stated_where_it_is_mounted():
    tool = op.Tool("pen", "tip", tcp=op.Pose((0.2, 0, 0)))
    goal = op.Pose((0.9, 0.5, 0.5), position_tolerance=0.5, orientation_tolerance=3.2)
    made = op.Problem("planar2r", [1.0, 0.0], goal, tool=tool)
    assert made.goal[0].frame == "pen"
    again = op.Problem(made.robot, [1.0, 0.0], goal)
    assert again.robot.tool_frame == "tool"


@pytest.mark.parametrize(
    ("change", "field", "found", "expected"),
    [
        (lambda d: d["tools"]["probe"]["tcp"].update(position=[0, 0, 10]), "tools.probe.tcp", "10 m", "metres"),
        (lambda d: d["tools"]["probe"].update(link="tipp"), "tools.probe.link", "unknown link 'tipp'", "'tip'"),
        (lambda d: d["tools"]["probe"].update(shapes=[]), "tools.probe", "a mass of a tool without bodies", "shapes"),
        (lambda d: d["tools"]["probe"]["tcp"].update({"in": "pen"}), "tools.probe.tcp.in", "unknown key 'in'", "rpy"),
        (lambda d: d["tools"].update(none=d["tools"].pop("pen")), "tools.none", "the name of no tool", "of its own"),
        (lambda d: d["tools"].update(tip=d["tools"].pop("pen")), "tools.tip", "already the name of", "of its"),
        (
            lambda d: d.update(scene=beside("bead")),
            "tools.probe.shapes[1].name",
            "'bead', which is already",
            "of its own",
        ),
        (
            lambda d: d.update(scene=beside("pen_2")) or d["tools"]["pen"].update(shapes=[BALL, BALL]),
            "tools.pen.shapes[1].name",
            "'pen_2', which is already the name of a body",
            "of its own",
        ),
        (
            lambda d: d["tools"]["pen"].update(shapes=[BALL | {"name": "bead"}]),
            "tools.pen.shapes[0].name",
            "'bead', which is already the name of a body of a tool",
            "of its own",
        ),
        (
            lambda d: d["tools"]["pen"].update(shapes=[BALL | {"name": "forearm"}]),
            "tools.pen.shapes[0].name",
            "'forearm', which is already the name of a",
            "of its own",
        ),
        (
            lambda d: d["tools"]["pen"].update(shapes=[BALL | {"name": "probe"}]),
            "tools.pen.shapes[0].name",
            "'probe', which is already the name of a tool",
            "of its own",
        ),
        (lambda d: d.update(tool="prob"), "tool", "unknown tool 'prob'", "'probe'"),
        (lambda d: d["task"][3].update(tool="pencil"), "task[3].tool", "unknown tool 'pencil'", "'pen'"),
        (lambda d: d["task"][1].update(tool="probe"), "task[1].tool", "mounted here", "pen, none"),
        (lambda d: d["task"][3].update(tool="none"), "task[3].tool", "no tool to leave", "probe, pen"),
        (
            lambda d: d["task"][2].update(move={"pose": {"frame": "probe", "position": [1, 0, 0]}}),
            "task[2].move.pose.frame",
            "unknown frame 'probe'",
            "tip",
        ),
        (
            lambda d: d.update(path_constraints=[{"tool_speed": {"linear": 0.5}}]),
            "path_constraints[0].tool_speed",
            "no `frame`, in a task that changes the tool",
            "such as 'probe', or the constraint in each step",
        ),
    ],
)
def test_what_does_not_fit_is_told_with_its_place(tmp_path, change, field, found, expected):
    issue = refused(tmp_path, change)[0]
    assert issue.field == field
    assert issue.line
    assert found in issue.found
    assert expected in issue.expected


def test_a_constraint_of_a_task_that_changes_tools_names_its_frame(problem):
    speed = {"linear": 5.0, "frame": "tip"}
    assert problem.with_constraints({"tool_speed": speed}).path_constraints[0].frame == "tip"


def test_a_tool_is_not_changed_from_rack_to_rack_in_one_step(tmp_path):
    def change(data):
        data["tools"]["probe"]["parked"] = {"position": [0.9, 0, 0]}
        data["task"][1]["tool"] = "pen"

    (issue, *_) = refused(tmp_path, change)
    assert "racks of their own" in issue.found
    assert "tool: none" in issue.expected
