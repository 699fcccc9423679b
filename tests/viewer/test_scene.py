import copy
import json
from collections import Counter

import numpy as np
import pinocchio as pin
import pytest

from optiplan.errors import OptiPlanError
from optiplan.geometry.scene import Box, Obstacle, Scene
from optiplan.problem.problem import JointGoal, PoseGoal, Via, derived
from optiplan.viewer.runs import ViewedRun
from optiplan.viewer.scene import build_scene
from tests.unchecked_problem import unchecked_problem


def named(scene, name, kind):
    (part,) = [p for p in scene.parts if p["name"] == name and p["set"] == kind]
    return part


def test_everything_is_drawn(shelf, motion):
    scene = build_scene(shelf, [("quintic", motion(shelf), None)])
    count = Counter(part["set"] for part in scene.parts)
    assert count["obstacle"] == len(shelf.scene.obstacles)
    assert count["attached"] == 1
    assert count["collision"] == len(shelf.robot.geometry.geometryObjects)
    assert count["visual"] >= len(shelf.robot.visual.geometryObjects) > 0
    assert {part["geometry"] for part in scene.parts} == set(range(len(scene.geometries)))
    json.dumps(scene.to_dict(), allow_nan=False)


def test_equal_shapes_are_sent_once(shelf):
    boxes = tuple(Obstacle(f"box{k}", Box((0.1, 0.1, 0.1)), pin.SE3.Random()) for k in range(1000))
    crowd = derived(shelf, scene=Scene(boxes))
    scene = build_scene(crowd, [])
    assert sum(part["set"] == "obstacle" for part in scene.parts) == 1000
    assert len({part["geometry"] for part in scene.parts if part["set"] == "obstacle"}) == 1


def test_parts_stand_where_the_problem_puts_them(shelf, panda):
    scene = build_scene(shelf, [])
    can = named(scene, "can", "obstacle")
    assert (can["body"], can["pose"]) == (0, pytest.approx([0.7, 0.2, 0.37, 0, 0, 0, 1]))
    part = named(scene, "part", "attached")
    data = panda.model.createData()
    pin.framesForwardKinematics(panda.model, data, shelf.start)
    drawn = data.oMi[part["body"]] * pin.XYZQUATToSE3(np.array(part["pose"]))
    held = shelf.scene.attached[0]
    assert drawn.isApprox(data.oMf[panda.model.getFrameId(held.link)] * held.X_LO, 1e-6)


def test_small_obstacles_have_another_colour(shelf):
    scene = build_scene(shelf, [])
    assert named(scene, "board", "obstacle")["colour"] == named(scene, "ground", "obstacle")["colour"]
    assert named(scene, "board", "obstacle")["colour"] != named(scene, "can", "obstacle")["colour"]


def test_links_without_visual_geometry_show_their_collision_geometry(shelf, panda):
    blind = copy.copy(panda)
    blind.__dict__["visual"] = pin.GeometryModel()
    scene = build_scene(derived(shelf, robot=blind), [])
    drawn = [(p["name"], p["geometry"]) for p in scene.parts if p["set"] == "visual"]
    assert drawn == [(p["name"], p["geometry"]) for p in scene.parts if p["set"] == "collision"]


def test_a_robot_without_bodies_is_drawn_as_its_frames_and_says_so(bare, shelf, motion):
    scene = build_scene(bare, [("quintic", motion(bare), None)])
    assert "Robot 'bare' has no bodies" in scene.note
    assert {part["set"] for part in scene.parts} == {"frame"}
    model, data = bare.robot.model, bare.robot.model.createData()
    pin.framesForwardKinematics(model, data, np.array([0.4, -0.9]))
    tips = {name: [] for name in (*model.names[1:], bare.robot.tool_frame)}
    for part in scene.parts:
        half = scene.geometries[part["geometry"]]["length"] / 2.0
        X = data.oMi[part["body"]] * pin.XYZQUATToSE3(np.array(part["pose"]))
        tips[part["name"]].append([X.act(np.array([0.0, 0.0, sign * half])) for sign in (-1.0, 1.0)])
    frames = [data.oMi[1], data.oMi[2], data.oMf[model.getFrameId(bare.robot.tool_frame)]]
    for rods, X in zip(tips.values(), frames, strict=True):
        axes = [rod for rod in rods if np.allclose(rod[0], X.translation)]  # and a rod from the frame before, if apart
        assert np.allclose(
            [end - start for start, end in axes[-3:]] @ X.rotation,
            np.linalg.norm(axes[-1][1] - axes[-1][0]) * np.eye(3),
        )
        assert any(np.allclose(rod[1], X.translation) for rod in rods) or np.allclose(X.translation, 0.0)
    assert build_scene(shelf, []).note == ""


def test_goal_ghost_stands_at_the_end_of_the_motion_or_at_the_goal(shelf, motion, planar):
    goal = build_scene(shelf, []).goal
    assert goal is not None
    assert goal == build_scene(shelf, [("quintic", motion(shelf), None)]).goal
    pose = PoseGoal(planar.tool_frame, pin.SE3.Identity())
    sought = unchecked_problem(
        name="pose", robot=planar, scene=Scene(), start=np.zeros(2), goal=(pose,), limits=planar.limits
    )
    scene = build_scene(sought, [("none", None, None)])
    assert (scene.goal, scene.targets) == (None, ([0, 0, 0, 0, 0, 0, 1],))


def test_run_of_another_robot_is_refused(shelf, motion, planar):
    other = unchecked_problem(
        name="flat", robot=planar, scene=Scene(), start=np.zeros(2), goal=(), limits=planar.limits
    )
    with pytest.raises(OptiPlanError, match="run 'quintic' moves 7 joints; robot 'planar2r' has 2"):
        build_scene(other, [("quintic", motion(shelf), None)])


def test_vias_are_marked_where_the_tool_passes(shelf):
    X = pin.SE3(np.eye(3), np.array([0.1, 0.2, 0.3]))
    vias = (Via(PoseGoal("panda_hand_tcp", X)), Via(JointGoal(shelf.start)))
    marked = build_scene(derived(shelf, vias=vias), []).targets[-2:]
    data = shelf.robot.model.createData()
    pin.framesForwardKinematics(shelf.robot.model, data, shelf.start)
    tool = data.oMf[shelf.robot.model.getFrameId(shelf.robot.tool_frame)]
    assert marked[0] == pytest.approx([0.1, 0.2, 0.3, 0.0, 0.0, 0.0, 1.0])
    assert marked[1] == pytest.approx(pin.SE3ToXYZQUAT(tool))


def test_no_two_runs_have_one_label(bare, motion):
    trajectory = motion(bare, 1.0)
    runs = [ViewedRun("a", trajectory, None, None, {"seed": seed}) for seed in (1, 2, 2)]
    found = build_scene(bare, [*runs, ViewedRun("b", trajectory), ViewedRun("c", None), ViewedRun("c", None)])
    labels = [run["label"] for run in found.runs]
    assert labels == ["a (seed 1)", "a (seed 2) (1)", "a (seed 2) (2)", "b", "c (1)", "c (2)"]
