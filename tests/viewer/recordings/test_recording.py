"""A run as plain arrays: bodies where the robot has them, curves as the page has them."""

import numpy as np
import pytest

from optiplan.errors import OptiPlanError
from optiplan.robot.frames import frame_pose
from optiplan.viewer.recordings.recording import recording_of
from optiplan.viewer.runs import ViewedRun
from tests.viewer.recordings.runs import attached_run, planned

ROUND = ("cylinder", "capsule")


def test_bodies_stand_where_the_robot_has_them():
    problem, run = planned()
    found = recording_of(problem, run)
    assert found.verified
    assert found.verdict.splitlines()[0] == "quintic: verified"
    assert found.t[[0, -1]] == pytest.approx([0.0, run.trajectory.duration])
    names = {body.name for body in found.bodies}
    assert "obstacles/ball" in names
    assert set(problem.robot.joint_names) <= names
    for k in (0, len(found.t) // 2, -1):
        q = run.trajectory(found.t[[k]])[0]
        X_WT = frame_pose(problem.robot, q, problem.robot.tool_frame)
        assert found.tool[k] == pytest.approx(X_WT.translation, abs=1e-6)
    ball = next(body for body in found.bodies if body.name == "obstacles/ball")
    assert ball.poses[:, :3] == pytest.approx(np.array([[-1.0, 0.18, 1.0]]))
    assert np.linalg.norm(ball.vertices, axis=1) == pytest.approx(0.1)
    position = next(curve for curve in found.curves if curve.name == "position")
    assert position.y[-1] == pytest.approx(run.trajectory.end, abs=1e-6)


def test_objects_of_a_task_go_with_the_hand():
    problem, run = attached_run()
    found = recording_of(problem, run)
    held = next(body for body in found.bodies if body.name == "objects/cube")
    assert len(held.poses) == len(found.t)
    assert np.linalg.norm(held.poses[-1, :3] - held.poses[0, :3]) > 0.02


def test_a_run_without_a_motion_is_refused():
    problem, _ = planned()
    with pytest.raises(OptiPlanError, match="no motion"):
        recording_of(problem, ViewedRun("quintic", None))


def test_every_shape_has_a_surface():
    shapes = ({"box": [0.1, 0.2, 0.3]}, {"sphere": 0.1}, *({kind: {"radius": 0.1, "length": 0.3}} for kind in ROUND))
    obstacles = [
        {"name": f"o{k}", "shape": shape, "pose": {"position": [2.0, k, 0.0]}} for k, shape in enumerate(shapes)
    ]
    obstacles.append({"name": "ground", "shape": {"half_space": {"normal": [0, 0, 1], "offset": -3.0}}})
    problem, run = planned(obstacles)
    found = {body.name: body for body in recording_of(problem, run).bodies}
    for k, half in enumerate(([0.05, 0.1, 0.15], [0.1] * 3, [0.1, 0.1, 0.15], [0.1, 0.1, 0.25])):
        assert np.abs(found[f"obstacles/o{k}"].vertices).max(axis=0) == pytest.approx(half, rel=0.02)
    assert found["obstacles/ground"].vertices[:, 2].max() == pytest.approx(-3.0)
