"""Tool paths of arms with hardly any joints, and of one with hundreds of configurations for a pose."""

import numpy as np
import pytest

from optiplan.kinematics.ik.closed_form import closed_form
from optiplan.planners.base import Budget
from optiplan.problem.load import problem_from_dict
from optiplan.robot.frames import frame_pose
from optiplan.robot.robot import load_robot
from optiplan.runs.pipeline import run

ROBOT = """\
version: 1
name: lever
dh:
  convention: standard
  unit: rad
  radius: 0.02
  rows:
    - {name: lever, joint: revolute, a: 0.5, mass: 1LIMITS}
limits: {velocity: 1.0, acceleration: 5.0, jerk: 50.0, torque: 20.0}
"""


def lever(folder, limits, planner):
    path = folder / "robot.yaml"
    path.write_text(ROBOT.replace("LIMITS", limits))
    goal = {"pose": {"position": [0.5 * np.cos(1.0), 0.5 * np.sin(1.0), 0.0], "rpy": [0.0, 0.0, 1.0]}}
    data = {"version": 1, "robot": str(path), "start": {"joints": [0.1]}, "goal": goal, "planner": planner}
    return problem_from_dict(data)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("limits", [", limits: [-3, 3]", ""])
@pytest.mark.parametrize("planner", [{"name": "screw"}, {"name": "sclerp"}, {"name": "arc", "centre": [0.0, 0.0, 0.0]}])
def test_one_joint_turns_about_its_axis(tmp_path, limits, planner):
    """Bounded or endless, without a warning, in the least time that the joint needs."""
    problem = lever(tmp_path, limits, planner)
    found = run(problem, problem.planner, problem.options, Budget(20.0), lambda stage, fraction: None)
    assert found.verified
    assert found.trajectory.end == pytest.approx([1.0], abs=1e-4)
    assert found.ratio == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("planner", [{"name": "line"}, {"name": "line", "free_orientation": True}])
def test_one_joint_draws_no_line(tmp_path, planner):
    problem = lever(tmp_path, "", planner)
    failure = run(problem, "line", problem.options, Budget(20.0), lambda stage, fraction: None).failure
    assert failure.kind == "unsupported"
    assert failure.witness["fraction"] == 0.0


@pytest.mark.parametrize("flip", ["wrist", "elbow"])
def test_the_branch_of_the_goal_is_found_among_many_turns(flip):
    """A UR5's joints turn twice: the branches nearest to the start are all its own, turned on."""
    robot, start = load_robot("ur5"), np.array([0.0, -1.3, 1.5, -1.8, -1.57, 0.2])
    X = frame_pose(robot, start, "tool0")
    X.translation = X.translation + np.array([0.0, 0.2, -0.1])
    found = closed_form(robot, "tool0").solve(X.homogeneous[None])
    joint = {"wrist": 4, "elbow": 2}[flip]
    opposite = [q for q in found.q[0][found.valid[0]] if q[joint] * start[joint] < 0.0 and abs(q[0]) < 1.0]
    data = {"version": 1, "robot": "ur5", "start": {"joints": start.tolist()}, "goal": {"joints": opposite[0].tolist()}}
    problem = problem_from_dict(data)
    assert not run(problem, "line", {}, Budget(20.0), lambda stage, fraction: None).verified
    changed = run(problem, "line", {"change_branch": True}, Budget(20.0), lambda stage, fraction: None)
    assert changed.info["branch_changed"]
    assert changed.verified
