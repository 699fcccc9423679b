"""A run that is followed by the controller."""

import numpy as np
import pytest

import optiplan as op
from optiplan.errors import InputError


@pytest.fixture(scope="module")
def run():
    return op.plan(op.load_problem("01_reach"))


def follow(run, controller, dt, start=None, most=3000):
    """Follow a run to its end; return the states."""
    motion = controller.follow(run)
    states = [run.trajectory.state(0.0) if start is None else start]
    while not motion.done and len(states) < most:
        states.append(controller.step(states[-1], dt).state)
    return motion, states


@pytest.mark.parametrize(("name", "form"), [("02_shelf", "velocity"), ("01_reach", "acceleration")])
def test_a_clear_run_is_followed_without_lag(name, form):
    run, dt = op.plan(op.load_problem(name), budget=2.0), 0.002
    controller = op.Controller(run.problem.robot, [], scene=run.problem.scene, form=form)
    motion, states = follow(run, controller, dt)
    assert motion.done
    planned = run.trajectory(np.minimum(dt * np.arange(len(states)), run.duration))
    assert np.abs(np.array([state.q for state in states]) - planned).max() < 1e-5


def test_rows_of_other_limits_hold_on_the_motion(run):
    """The run's tool goes at more than 1 m/s; the solver that is named is that of the step, not of the last one."""
    robot = run.problem.robot
    joints = op.PositionLimit(), op.VelocityLimit(), op.AccelerationLimit(), op.JerkLimit()
    controller = op.Controller(robot, [], limits=[*joints, op.ToolSpeedLimit(linear=0.25)])
    motion, frame, speeds, solvers = controller.follow(run), robot.frame_id(robot.tool_frame), [], set()
    state = run.trajectory.state(0.0)
    while not motion.done and len(speeds) < 5000:
        step = controller.step(state, 0.002)
        state = step.state
        speeds.append(np.linalg.norm((controller.configuration(state).jacobian(frame) @ state.v)[:3]))
        solvers.add(step.solver)
    assert motion.done
    assert max(speeds) <= 0.25 * (1.0 + 1e-3)
    assert {"motion", "active set"} <= solvers
    assert "braking" not in solvers


def test_from_beside_the_path_the_robot_comes_back_to_it(run):
    controller = op.Controller(run.problem.robot, [])
    motion, states = follow(run, controller, 0.002, op.State(run.trajectory.start + 0.02))
    assert motion.done
    assert np.abs(states[-1].q - run.trajectory.end).max() < 2e-3


@pytest.mark.parametrize("turns", [1.0, -2.0])
def test_a_joint_without_limits_follows_in_the_turn_in_which_it_stands(tmp_path, turns):
    file = tmp_path / "robot.yaml"
    dh = "{convention: standard, unit: rad, radius: 0.05, rows: [{name: turn, joint: revolute, a: 0.3}]}"
    file.write_text(f"version: 1\nname: one\ndh: {dh}\nlimits: {{velocity: 2, acceleration: 8, jerk: 80}}\n")
    run = op.plan(op.Problem(str(file), [0.1], [1.5]), budget=1.0)
    q = run.trajectory.start + 2.0 * np.pi * turns
    motion, states = follow(run, op.Controller(run.problem.robot, []), 0.002, op.State(q))
    assert motion.done
    assert states[-1].q == pytest.approx(run.trajectory.end + 2.0 * np.pi * turns, abs=2e-3)
    assert len(states) < 1.5 * run.duration / 0.002


def test_what_a_motion_passes_is_passed_where_an_obstacle_is_placed_anew(run):
    robot, t = run.problem.robot, 0.6 * run.duration
    tip = robot.fk(run.trajectory(t)).matrix[:3, 3]
    pose = op.Pose((*tip[:2], tip[2] - 0.077))
    ball = op.Sphere("ball", radius=0.05, position=pose.position)
    controller = op.Controller(robot, [], scene=run.problem.scene.with_(ball))
    controller.follow(run)
    before = dict(zip(controller.limits[-1].labels, controller.limits[-1].least, strict=True))
    assert 0.0 < min(least for pair, least in before.items() if "ball" in pair) < 0.004
    controller.update_scene({"ball": pose})
    after = dict(zip(controller.limits[-1].labels, controller.limits[-1].least, strict=True))
    assert {pair: after[pair] for pair in before} == before
    op.Controller(robot, [], limits=controller.limits)  # another one follows nothing yet
    assert (controller.limits[-1].least == controller.limits[-1].at_least).all()


def test_the_motion_waits_for_a_robot_that_an_obstacle_holds_back_and_is_finished_when_it_leaves(run):
    robot = run.problem.robot
    there = robot.fk(run.trajectory(0.6 * run.duration)).matrix[:3, 3]
    ball = op.Sphere("ball", radius=0.05, position=(2.0, 0.0, 0.5))
    controller = op.Controller(robot, [], scene=run.problem.scene.with_(ball))
    motion, state = controller.follow(run), run.trajectory.state(0.0)
    for k in range(round(1.5 * run.duration / 0.002)):
        if k == 50:
            controller.update_scene({"ball": op.Pose(tuple(there))})
        state = controller.step(state, 0.002).state
    assert motion.time < 0.8 * run.duration, "it waits"
    left = 3000
    while left > 0:
        controller.update_scene({"ball": op.Pose((2.0, 0.0, 0.5))})
        state = controller.step(state, 0.002).state
        left = min(left - 1, 250) if motion.done else left - 1  # half a second to come to rest
    assert motion.done
    assert np.abs(state.q - run.trajectory.end).max() < 1e-4


@pytest.mark.parametrize("moves", [False, True])
def test_an_obstacle_that_the_motion_was_not_proved_among_keeps_its_distance(run, moves):
    """A ball that stands on the path when `follow` begins, or will be there when the robot is."""
    robot, t = run.problem.robot, 0.6 * run.duration
    there = robot.fk(run.trajectory(t)).matrix[:3, 3]
    ball = op.Sphere("ball", radius=0.05, position=tuple(there))
    if moves:
        ball = op.Sphere("ball", radius=0.05, position=(there[0] + 0.5, *there[1:])).moving(
            [[0, -0.5 / t], [0], [0]], t
        )
    controller = op.Controller(robot, [], scene=run.problem.scene.with_(ball))
    motion, state, nearest = controller.follow(run), run.trajectory.state(0.0), np.inf
    for _ in range(600):
        step = controller.step(state, 0.005)
        state = step.state
        if step.nearest is not None and step.nearest.b == "ball":
            nearest = min(nearest, step.nearest.distance)
    assert not motion.done
    assert 0.005 - 1e-6 < nearest < 0.02


@pytest.mark.parametrize("given", [None, "a path", object()])
def test_what_is_no_motion_is_refused(run, given):
    with pytest.raises(InputError, match=r"Controller\.follow.*run.*op\.Trajectory"):
        op.Controller(run.problem.robot, []).follow(given)


def test_a_motion_of_other_joints_is_refused(run):
    with pytest.raises(InputError, match=r"Controller\.follow.*panda_joint1.*shoulder_pan_joint"):
        op.Controller(op.load_robot("ur5"), []).follow(run)
