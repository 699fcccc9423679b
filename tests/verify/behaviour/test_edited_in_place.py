"""What a verdict is about cannot be edited behind its back: bodies are made of poses and limits once and kept."""

import copy
import pickle

import numpy as np
import pinocchio as pin
import pytest

import optiplan as op
from optiplan.geometry.poses import FixedPose
from optiplan.verify.verify import verify
from tests.verify.motions import quintic


@pytest.fixture
def problem():
    wall = op.Box("wall", size=(0.1, 0.1, 0.1), position=(-3.0, 0.0, 0.0))
    return op.Problem("planar2r", [0.1, 0.2], [0.4, 0.2], scene=[wall])


def edits(X):
    return [
        lambda: setattr(X, "translation", np.ones(3)),
        lambda: setattr(X, "rotation", np.eye(3)),
        lambda: X.translation.__setitem__(0, 1.0),
        lambda: X.rotation.__setitem__((0, 0), 1.0),
        X.setIdentity,
        X.setRandom,
    ]


def test_poses_of_bodies_and_path_constraints_are_read_only(problem):
    (wall,) = problem.scene.obstacles
    (box,) = problem.with_constraint(op.PositionBox("tool", (3, 3, 3), pin.SE3.Identity())).path_constraints
    (pose,) = problem.with_goal(op.Pose((1.1, 0.7, 0.0), frame="tool")).goal
    poses = [(pose, pose.X_WG), ("base", problem.robot.mounting.X_WB)]
    for body, X in (*poses, ("box", box.X_WC), (wall, wall.X_WO), (held := wall.attached_to("link2"), held.X_LO)):
        before = X.copy()
        for edit in edits(X):
            with pytest.raises((AttributeError, ValueError)):
                edit()
        assert before == X, body


def test_a_pose_that_is_edited_later_is_not_that_of_the_body(problem):
    """Once the verifier called this motion free of a wall that had been put in its way in place."""
    motion = quintic(problem.robot.joint_names, problem.start, problem.goal[0].q, 3.0)
    X = pin.SE3(np.eye(3), np.array([-3.0, 0.0, 0.0]))
    (wall,) = problem.scene.obstacles
    there = problem.with_scene([op.Obstacle("wall", wall.shape, X)])
    assert verify(there, motion).verified
    X.translation = np.array(problem.robot.fk(motion(1.5)).position)
    assert there.scene.obstacles[0].X_WO.translation[0] == -3.0
    assert not verify(problem.with_scene([op.Obstacle("wall", wall.shape, X)]), motion).verified


def test_what_else_a_problem_and_its_robot_hold_is_read_only(problem):
    """`op.certify` keeps the limits of a problem, and once proved chunks with those from before an edit.

    The hash of a problem is that of its goals and path constraints as they were stated.
    """
    turn = {"axis": (0, 0, 1), "angle": [0, 1], "about": (0, 0, 0)}
    motion = problem.scene.obstacles[0].moving([[0], [0, 0.2], [0]], turn=turn).motion
    arrays = [motion.coefficients, motion.axis, motion.point, *vars(problem.limits).values()]
    to = problem.with_goal(op.State([0.4, 0.2], [0.1, 0.0])).with_vias([0.3, 0.2])
    arrays += [problem.goal[0].q, to.goal[0].velocity, to.vias[0].at.q]
    arrays += [*problem.robot.configurations.values(), problem.robot.mounting.gravity, problem.robot.revolute]
    box = op.PositionBox("tool", (3, 3, 3), pin.SE3.Identity())
    balance = op.TipOver([[0, 0], [1, 0], [0, 1]])
    box, balance = problem.with_constraint(box).with_constraint(balance).path_constraints
    ground = balance.polygon
    arrays += [box.size, balance.corners, ground.corners, ground.normals, ground.offsets]
    for array in [*arrays, *vars(problem.limits.scaled(velocity=0.5)).values()]:
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0.0


def test_a_body_without_a_pose_is_bad_input():
    with pytest.raises(op.InputError, match="X_WO"):
        op.Obstacle("wall", op.Box("wall", size=(1, 1, 1)).shape, np.eye(4))


@pytest.mark.parametrize("again", [copy.copy, copy.deepcopy, lambda X: pickle.loads(pickle.dumps(X))])
def test_a_read_only_pose_is_copied_and_pickled(problem, again):
    X = problem.scene.obstacles[0].X_WO
    assert again(X) == X
    assert isinstance(again(X), FixedPose)
    assert (X * X.inverse()).isIdentity()


@pytest.mark.parametrize("again", [copy.deepcopy, lambda one: pickle.loads(pickle.dumps(one))])
def test_a_run_from_another_process_and_a_copy_are_read_only_as_well(again):
    """Runs of `op.plan_many` come so: a motion edited in place kept its verdict, and was executed."""
    run = again(op.plan(op.load_problem("38_falling_ball"), budget=2.0))
    motions = [one.motion.coefficients for one in run.problem.scene.obstacles if one.motion is not None]
    motion, limits, start = run.trajectory, run.problem.limits, run.problem.start_state
    kept = [motion.coefficients, motion.breakpoints, limits.velocity, run.problem.start, start.q, op.State(start.q).v]
    kept += [motion.start, motion.end, *motion.extrema(1), motion.unit_pieces(1), motion.derivatives(1)]
    for array in [*kept, *motions]:
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0
    assert op.verify(run.problem, run.trajectory).verified
