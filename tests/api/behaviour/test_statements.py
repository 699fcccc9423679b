"""Robots, scenes, poses and problems from Python alone."""

import pickle

import numpy as np
import pinocchio as pin
import pytest

import optiplan as op
from optiplan.resources import robots_dir

URDF = robots_dir() / "planar2r" / "planar2r.urdf"


def test_a_robot_needs_nothing_but_its_urdf(tmp_path):
    robot = op.Robot.from_urdf(
        URDF, tool_frame="tool", configurations={"bent": [0.3, 0.5]}, limits={"acceleration": 5.0, "jerk": 50.0}
    )
    problem = op.Problem(robot, start="bent", goal=[1.0, 1.0])
    run = op.plan(problem, "quintic")
    assert run.verified
    run.save(tmp_path / "run")  # whole without any file of ours but the URDF
    again = op.load_run(tmp_path / "run")
    assert again.verified
    assert again.problem.hash == problem.hash
    assert again.problem.robot.configurations["bent"].tolist() == [0.3, 0.5]
    problem.save(tmp_path / "problem.yaml")
    assert op.load_problem(tmp_path / "problem.yaml").hash == problem.hash
    assert pickle.loads(pickle.dumps(robot)).fingerprint == robot.fingerprint
    assert op.Robot.from_urdf(URDF, tool_frame="tool").fingerprint != robot.fingerprint


def test_a_problem_file_may_hold_its_robot(tmp_path):
    text = f"version: 1\nrobot: {{urdf: {URDF}, tool_frame: tol}}\n"
    text += "start: {joints: [0, 0]}\ngoal: {joints: [1, 1]}\n"
    (tmp_path / "p.yaml").write_text(text)
    with pytest.raises(op.InputError, match=r"p\.yaml:2: robot\.tool_frame: unknown frame 'tol'"):
        op.load_problem(tmp_path / "p.yaml")
    (tmp_path / "p.yaml").write_text(text.replace("tol}", "tool}"))
    problem = op.load_problem(tmp_path / "p.yaml")
    said = op.Problem(op.Robot.from_urdf(URDF, tool_frame="tool"), start=[0, 0], goal=[1, 1], name=problem.name)
    assert said.hash == problem.hash


def test_a_robot_with_another_tool_says_which_frame_a_pose_is_about(planar):
    frame = "forearm"
    problem = op.Problem(
        planar.with_tool(frame), start=[0.2, 0.3], goal=op.Pose((0.9, 0.3, 0), orientation_tolerance=4.0)
    )
    assert problem.goal[0].frame == frame
    assert op.load_problem(problem.source).goal[0].frame == frame


def test_scenes_change_by_making_others():
    shelf = op.Box("shelf", size=(0.8, 0.3, 0.02), position=(0.5, 0, 0.4), rpy=(0, 0, 0.1))
    bar = op.Capsule("bar", radius=0.01, length=0.2).attached_to("panda_hand", touch=["panda_leftfinger"])
    scene = op.Scene([shelf, op.Sphere("ball", radius=0.1, position=(0, 1, 1))], [bar], [("shelf", "ball")])
    moved = scene.moved("shelf", z=0.05)
    assert moved.obstacles[0].X_WO.translation.tolist() == [0.5, 0, 0.45]
    assert np.array_equal(moved.obstacles[0].X_WO.rotation, shelf.X_WO.rotation)
    assert scene.obstacles[0].X_WO.translation[2] == 0.4
    assert scene.moved("bar", x=0.1).attached[0].X_LO.translation.tolist() == [0.1, 0, 0]
    assert scene.without("ball").names == ("shelf", "bar")
    assert not scene.without("ball").allowed
    other = scene.with_(op.Sphere("ball", radius=0.2), op.Box("new", size=(1, 1, 1)), allowed=[("new", "ball")])
    assert other.names == ("shelf", "ball", "new", "bar")
    assert other.obstacles[1].shape.radius == 0.2
    assert len(other.allowed) == 2


def test_a_moved_shelf_is_the_shelf_that_a_file_would_put_there(tmp_path):
    shelf = op.Box("shelf", size=(0.2, 0.2, 0.2), position=(0.6, 0, 0.2), rpy=(0, 0, 0.3))
    problem = op.Problem("panda", "ready", [0.1, -0.785, 0, -2.356, 0, 1.571, 0.785], [shelf])
    there = op.Box("shelf", size=(0.2, 0.2, 0.2), position=(0.6, 0, 0.25), rpy=(0, 0, 0.3))
    assert problem.with_scene(problem.scene.moved("shelf", z=0.05)).hash == problem.with_scene([there]).hash


def test_poses_can_be_said_in_four_ways():
    X = pin.SE3(pin.rpy.rpyToMatrix(3.0, 0.1, -0.2), np.array([0.5, 0.1, 0.4]))
    quaternion = pin.Quaternion(X.rotation).coeffs()
    ways = [
        op.Pose((0.5, 0.1, 0.4), rpy=(3.0, 0.1, -0.2)),
        op.Pose(np.array([0.5, 0.1, 0.4]), quaternion=quaternion),
        op.Pose.from_matrix(X.homogeneous),
        op.Pose.from_matrix(X),
    ]
    for pose in ways:
        assert np.allclose(pose.matrix, X.homogeneous, atol=1e-12)
    for pose in (*ways, X):
        assert np.allclose(op.Problem("panda", "ready", pose).goal[0].X_WG.homogeneous, X.homogeneous, atol=1e-12)


def test_with_takes_what_the_problem_takes(problem):
    assert problem.with_start([0.5, 0.5]).start.tolist() == [0.5, 0.5]
    assert np.array_equal(problem.with_start("out").start, problem.robot.configurations["out"])
    assert problem.with_goal("out").goal[0].q.tolist() == problem.robot.configurations["out"].tolist()
    assert len(problem.with_goal("out", [0.1, 0.2]).goal) == 2
    assert len(problem.with_goal(["out", [0.1, 0.2]]).goal) == 2
    past = problem.with_vias([0.1, 0.2], op.ViaPoint("out", tolerance=0.1))
    assert [via.at.tolerance for via in past.vias] == [1e-6, 0.1]
    assert past.with_vias().hash == problem.hash
    slower = problem.with_limits(velocity=0.5)
    assert np.array_equal(slower.limits.velocity, 0.5 * problem.robot.limits.velocity)
    assert slower.hash != problem.hash
    said = op.Problem(problem.robot, "ready", [0.4, 0.9], problem.scene, limits={"velocity": 0.5}, name="turn")
    assert said.hash == slower.hash


def test_a_problem_and_its_parts_say_what_they_are_in_a_line(problem, run):
    assert repr(problem) == "Problem: turn, planar2r, to a configuration; 1 obstacle (wall)"
    assert repr(problem.with_vias([0.1, 0.2])) == repr(problem).replace(";", " past 1 point;")
    assert repr(problem.robot).startswith("Robot: planar2r, 2 joints, tool frame ")
    assert repr(run).startswith("Run: verified, ")
    assert repr(run.trajectory).startswith("Trajectory: ")
    assert repr(run.report).startswith("Report: verified (")
    for thing in (problem.robot, run.trajectory):
        assert "joints: shoulder, elbow" in repr(thing)
    assert ", velocity, acceleration" in repr(run.report)
    controller = op.Controller(problem.robot, [op.PostureTask()])
    assert repr(controller).startswith("Controller: planar2r, tasks: PostureTask(")
    assert repr(controller).endswith("; limits: position, velocity, acceleration, jerk")
    for thing in (problem, run, run.report, run.trajectory, op.planners(), op.robots()):
        assert "\n" not in repr(thing) or thing in (op.planners(), op.robots())
        assert "<" in thing._repr_html_()
    assert "<svg" in run._repr_html_()
    failed = op.plan(problem, "quintic", {"duration": 0.01})
    assert repr(failed).startswith("Run: no motion (limits: ")
    assert repr(failed.failure).startswith("Failure: limits: ")


def test_nobody_writes_into_the_start_of_a_problem(problem):
    with pytest.raises(ValueError, match="read-only"):
        problem.start[0] = 9.0
    mine = np.array([0.5, 1.0])
    other = problem.with_start(mine)
    mine[0] = 9.0
    assert other.start.tolist() == [0.5, 1.0]
