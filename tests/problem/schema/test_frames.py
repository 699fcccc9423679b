"""Poses that are said in obstacles and named frames."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import optiplan as op
from optiplan.config.document import parse_yaml
from optiplan.errors import InputError
from optiplan.geometry.poses import pose_from_data
from optiplan.problem.from_data import read_problem
from optiplan.problem.load import load_problem, problem_from_dict
from optiplan.problem.schema.problem import problem_schema

TABLE = {"name": "table", "shape": {"box": [0.6, 1.0, 0.04]}, "pose": {"position": [0.5, 0, 0.1], "rpy": [0, 0, 0.3]}}
TRAY = {"in": "table", "position": [0.1, 0.2, 0.02], "rpy_deg": [0, 0, 45]}
SLOT = {"in": "tray", "position": [0.05, 0, 0]}
GOAL = {"in": "slot", "position": [0, 0, 0.1], "rpy_deg": [180, 0, 0], "offset": {"position": [0, 0, -0.02]}}


def problem(**more):
    data = {"version": 1, "robot": "panda", "start": {"configuration": "ready"}, "goal": {"pose": GOAL}}
    return data | {"frames": {"slot": SLOT, "tray": TRAY}, "scene": {"obstacles": [TABLE]}} | more


def test_a_pose_is_the_product_of_its_frames_and_its_offset():
    found = problem_from_dict(problem())
    chain = [TABLE["pose"], TRAY, SLOT, GOAL, GOAL["offset"]]
    wanted = pin.SE3.Identity()
    for pose in chain:
        wanted = wanted * pose_from_data(pose)
    np.testing.assert_allclose(pose_from_data(found.source["goal"]["pose"]).homogeneous, wanted.homogeneous, atol=1e-12)
    again = problem_from_dict(found.source)
    assert again.hash == found.hash
    assert "frames" not in found.source


@pytest.mark.parametrize("named", [{"in": "slot"}, {}])
def test_an_offset_of_nothing_states_nothing(named):
    pose = {"position": [0.5, 0, 0.4], "rpy_deg": [180, 0, 0], **named}
    plain, said = (problem_from_dict(problem(goal={"pose": {**pose, **more}})) for more in ({}, {"offset": None}))
    np.testing.assert_allclose(said.goal[0].X_WG.homogeneous, plain.goal[0].X_WG.homogeneous, atol=1e-12)


def test_poses_of_python_are_products():
    table, tray = (op.Pose(**{key: one[key] for key in one if key != "in"}) for one in (TABLE["pose"], TRAY))
    goal = table @ tray @ op.Pose((0.05, 0, 0.08), rpy_deg=(180, 0, 0), frame="panda_hand", position_tolerance=1e-3)
    wanted = (
        pose_from_data(TABLE["pose"])
        * pose_from_data(TRAY)
        * pin.SE3(pin.rpy.rpyToMatrix(np.pi, 0, 0), np.array([0.05, 0, 0.08]))
    )
    np.testing.assert_allclose(goal.matrix, wanted.homogeneous, atol=1e-11)
    assert (goal.frame, goal.position_tolerance) == ("panda_hand", 1e-3)


def test_obstacles_vias_regions_and_steps_of_a_task_are_said_in_frames():
    cup = {"name": "cup", "shape": {"sphere": 0.03}, "pose": {"in": "tray", "position": [0, 0.1, 0.06]}}
    region = {"region": {"in": "tray", "position": [0, 0, 0.2], "rpy": [3.1416, 0, 0], "along": {"x": 0.02}}}
    found = problem_from_dict(problem(goal=region, scene={"obstacles": [TABLE, cup]}))
    X_WT = pose_from_data(TABLE["pose"]) * pose_from_data(TRAY)
    np.testing.assert_allclose(found.scene.obstacles[1].X_WO.translation, X_WT.act(np.array([0, 0.1, 0.06])))
    np.testing.assert_allclose(found.source["goal"]["region"]["position"], X_WT.act(np.array([0, 0, 0.2])))
    approach = {"approach": {"pose": {"in": "tray", "position": [0, 0, 0.1], "rpy": [3.1416, 0, 0]}, "distance": 0.05}}
    steps = [approach, {"line": {"by": [0, 0, 0.05], "in": "tool"}}]
    task = problem_from_dict({key: value for key, value in problem(task=steps).items() if key != "goal"})
    np.testing.assert_allclose(task.source["task"][0]["approach"]["pose"]["position"], X_WT.act(np.array([0, 0, 0.1])))


WRONG = """\
version: 1
robot: panda
start: {configuration: ready}
frames:
  a: {in: b}
  b: {in: a, position: [0, 0, 1]}
  table: {position: [0, 0, 0]}
  far: {in: table, position: [0, 0, 1], offset: {position: [0, 0, 100]}}
  odd: {in: table, positions: [0, 0, 1]}
  world: {}
goal: {pose: {in: tabel, position: [0, 0, 0.1]}}
scene: {obstacles: [{name: table, shape: {box: [0.6, 1.0]}, pose: {position: [0.5, 0, 0.1]}}]}
"""


@pytest.mark.parametrize(
    ("line", "field", "words"),
    [
        (6, "frames.b.in", "a circle of frames: a in b in a"),
        (7, "frames.table", "the name of an obstacle"),
        (8, "frames.far.offset.position", ": 100 m; expected metres, at most 5"),
        (9, "frames.odd.positions", "position"),
        (10, "frames.world", "the world's own name"),
        (11, "goal.pose.in", "did you mean 'table'"),
        (12, "scene.obstacles[0].shape.box", "expected"),
    ],
)
def test_what_is_wrong_is_told_with_its_line(line, field, words):
    with pytest.raises(InputError) as refused:
        read_problem(parse_yaml(WRONG, Path("cell.yaml")), Path())
    (issue,) = [issue for issue in refused.value.issues if issue.field == field]
    assert issue.line == line
    assert words in str(refused.value)


OTHERS = {
    "scene.attached[0].pose.in": {
        "scene": {
            "obstacles": [TABLE],
            "attached": [{"name": "part", "link": "panda_hand", "shape": {"sphere": 0.02}, "pose": SLOT}],
        }
    },
    "path_constraints[0].relative_pose.in": {
        "path_constraints": [
            {"relative_pose": {"to": "panda_link0", "tolerance": {"position": 1.0, "orientation": 3.0}, **SLOT}}
        ]
    },
    "goal.region.offset.in": {"goal": {"region": {"position": [0.5, 0, 0.4], "along": {"x": 0.1}, "offset": SLOT}}},
}


NO_POSES = {
    "path_constraints[0].fixed_orientation.in": {
        "path_constraints": [{"fixed_orientation": {"in": "table", "rpy": [3.1, 0, 0], "within": 0.1}}]
    },
    "path_constraints[0].plane.in": {
        "path_constraints": [{"plane": {"in": "table", "normal": [0, 0, 1], "offset": 0.5, "within": 1.0}}]
    },
    "scene.obstacles[1].in": {"scene": {"obstacles": [TABLE, {"name": "b", "in": "table", "shape": {"sphere": 0.1}}]}},
    "goal.in": {"goal": {"in": "table", "joints": [0.0] * 7}},
}


@pytest.mark.parametrize(("field", "more"), (OTHERS | NO_POSES).items(), ids=OTHERS | NO_POSES)
def test_what_is_no_pose_or_one_in_a_link_or_another_pose_has_no_frame(field, more):
    with pytest.raises(InputError) as caught:
        problem_from_dict(problem(**more))
    assert [issue.field for issue in caught.value.issues] == [field]
    assert "unknown key 'in'" in str(caught.value)


BELT = {"motion": {"polynomial": [[0], [0, 0.1], [0]]}}
FAR = {"shape": {"sphere": 0.1}, "pose": {"position": [9, 9, 9]}}


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"frames": ["tray"], "goal": {"configuration": "ready"}}, "frames: a list of 1 value; expected poses by name"),
        (
            {"goal": {"pose": {"in": "table", "position": [0, 0, "0.3"]}}},
            "goal.pose.position[2]: '0.3'; expected a num",
        ),
        ({"frames": {"slot": {"position": [0, 0, "0.3"]}}}, "frames.slot.position[2]: '0.3'; expected a number"),
        ({"goal": {"pose": {**GOAL, "offset": 3}}}, "goal.pose.offset: 3; expected a mapping"),
        ({"goal": {"pose": {**GOAL, "offset": {"z": 1}}}}, "goal.pose.offset.z: unknown key 'z'"),
        ({"frames": {"slot": {}, "tool": BELT}}, "frames.tool: 'tool', the tool's own name"),
        ({"scene": {"obstacles": [TABLE, {"name": "world", **FAR}]}}, "scene.obstacles[1]: an obstacle called world"),
        ({"scene": {"obstacles": [TABLE, {"name": "tool", **FAR, **BELT}]}}, "an obstacle called tool"),
    ],
)
def test_frames_and_poses_in_them_are_of_the_right_kind(more, words):
    with pytest.raises(InputError) as caught:
        problem_from_dict(problem(**more))
    assert words in str(caught.value)


def test_editors_know_the_keys():
    schema = problem_schema()
    assert "frames" in schema["properties"]
    for name in ("PoseSpec", "PoseGoalSpec", "RegionSpec"):
        assert {"in", "offset"} <= set(schema["$defs"][name]["properties"])
    for name, key in (("AttachedSpec", "pose"), ("ToolSpec", "tcp"), ("PoseSpec", "offset"), ("RegionSpec", "offset")):
        kind = schema["$defs"][name]["properties"][key]["$ref"].split("/")[-1]
        assert not {"in", "offset"} & set(schema["$defs"][kind]["properties"])


def test_a_link_that_no_joint_moves_is_a_frame(tmp_path):
    """The torso of Baxter carries its arms and stands on the base, which stands anywhere."""
    text = "version: 1\nrobot: baxter_left\nbase: {position: [0, 0, 1]}\nstart: {configuration: ready}\n"
    text += "goal: {pose: {in: left_arm_mount, position: [0.6, 0.1, 0.1]}}\n"
    file = tmp_path / "link.yaml"
    file.write_text(text)
    problem = load_problem(file)
    robot = op.load_robot("baxter_left")
    X = robot.fk(problem.start, "left_arm_mount").matrix
    assert np.allclose(problem.goal[0].X_WG.translation, (X @ [0.6, 0.1, 0.1, 1])[:3] + np.array([0, 0, 1]))
    file.write_text(text.replace("in: left_arm_mount", "in: left_gripper"))
    with pytest.raises(InputError) as caught:
        load_problem(file)
    assert caught.value.issues[0].line == 5
    assert "'left_gripper', a link that joints move" in caught.value.issues[0].found
    assert "torso" in caught.value.issues[0].expected
