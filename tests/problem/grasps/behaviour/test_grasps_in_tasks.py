"""Grasps, places and objects in hand as ends of a task: read, planned, proved, refused."""

import numpy as np
import pinocchio as pin
import pytest

import optiplan as op
from optiplan.errors import InputError
from optiplan.problem.goals_and_vias import PoseGoal
from optiplan.problem.task.scene_change import scene_after
from optiplan.problem.task.timeline import steps_in_time
from optiplan.robot.frames import frame_pose

FINGERS = ("panda_leftfinger", "panda_rightfinger")
SCENE = [
    op.Box("table", size=(0.7, 1.2, 0.04), position=(0.5, 0, -0.02)),
    op.Box("cube", size=(0.05, 0.05, 0.1), position=(0.5, 0.2, 0.051), rpy_deg=(0, 0, 30)),
]
PLACE = op.Region((0.5, 0, 0.052), along={"x": 0.1, "y": 0.1}, about={"z": "free"}, frame="cube")


def finger(name, y):
    return op.Box(name, size=(0.02, 0.01, 0.06), position=(0, y, 0.12))


PALM = op.Box("palm", size=(0.06, 0.12, 0.08), position=(0, 0, 0.045))
HAND = op.Tool(
    "hand",
    "tool0",
    tcp=op.Pose((0, 0, 0.14)),
    shapes=[PALM, finger("left", 0.045), finger("right", -0.045)],
    touch=("wrist_3_link", "ee_link"),
)


def grasped(grasps):
    return op.Task().approach(grasps, 0.08).attach("cube", "tool0", mass=0.1)


@pytest.fixture(scope="module")
def problem():
    task = grasped(op.Grasps("cube", opening=0.078)).retreat(0.08, along=(0, 0, 1), within="world")
    task = task.approach(PLACE, 0.05, along=(0, 0, -1)).detach("cube")
    return op.Problem("ur5", "ready", task=task, scene=SCENE, tool=HAND)


def test_grasps_are_poses_of_the_gripper_in_the_world(problem):
    ends = problem.task[1].action.ends
    X_WO = problem.scene.obstacles[1].X_WO
    assert len(ends) > 12
    for end in ends:
        X_OF = X_WO.actInv(end.X_WG)
        assert np.abs(X_OF.rotation.T @ X_OF.rotation - np.eye(3)).max() < 1e-9
        assert np.sort(np.abs(X_OF.rotation), axis=None)[-3:] == pytest.approx([1, 1, 1])  # square to the faces


def test_a_grasp_and_a_place_are_chosen_and_proved(problem):
    run = op.plan(problem, planner="quintic", budget=60.0)
    assert run.verified
    scene = final_scene(problem, run.trajectory)  # the cube ends in its region, upright, wherever it was grasped
    (cube,) = (one for one in scene.obstacles if one.name == "cube")
    x, y, z = cube.X_WO.translation
    assert abs(x - 0.5) <= 0.1
    assert abs(y) <= 0.1
    assert z == pytest.approx(0.052, abs=2e-4)
    assert np.allclose(cube.X_WO.rotation[:, 2], [0, 0, 1], atol=2e-3)


def final_scene(problem, trajectory):
    *_, (step, scene, _, end) = steps_in_time(problem, trajectory)
    return scene_after(scene, step.action, problem.robot, trajectory(end))


def test_an_object_in_hand_is_a_frame(problem):
    """Held from the start: the pose of the object is the goal, wherever in the hand it is."""
    X_LO = pin.SE3(pin.exp3(np.array([0.2, 0.1, 0.0])), np.array([0.01, 0.0, 0.13]))
    cube = op.Attachment("cube", op.Box("x", size=(0.04, 0.04, 0.04)).shape, "panda_hand", X_LO, frozenset(FINGERS))
    goal = op.Pose((0.5, 0.2, 0.4), rpy_deg=(180, 0, 0), frame="cube")
    held = op.Problem("panda", "ready", goal, op.Scene([], [cube]))
    run = op.plan(held, budget=20.0)
    assert run.verified
    X_WL = frame_pose(op.load_robot("panda"), run.trajectory.end, "panda_hand")
    assert np.allclose((X_WL * X_LO).translation, [0.5, 0.2, 0.4], atol=1e-4)
    assert isinstance(held.goal[0], PoseGoal)
    with pytest.raises(InputError, match="unknown frame 'cube'"):
        op.Problem("panda", "ready", goal)


@pytest.mark.parametrize(
    ("task", "words"),
    [
        (grasped(op.Grasps("cub", opening=0.078)), "unknown object 'cub'"),
        (grasped(op.Grasps("cube", opening=0.03)), "0.05 m wide; expected at most the opening"),
        (grasped(op.Grasps("cube", opening=0.078, closing="z")), "z, not square to `along`"),
        (
            grasped(op.Grasps("cube", opening=0.078)).detach("cube").approach(op.Grasps("cube", 0.078), 0.1),
            "moves before",
        ),
        (op.Task().approach(op.Region((0.5, 0, 0.1), along={"x": "free"}), 0.1), "no bound along x"),
        (op.Task().move(op.Pose((0.5, 0, 0.4), frame="cube")), "unknown frame 'cube'"),
    ],
)
def test_what_does_not_fit_is_told(task, words):
    with pytest.raises(InputError, match=words.replace("(", r"\(")):
        op.Problem("ur5", "ready", task=task, scene=SCENE, tool=HAND)
