"""Meetings with what moves: when they are, why there are none, and tasks with alternatives."""

import numpy as np
import pinocchio as pin
import pytest

import optiplan as op
from optiplan.geometry.obstacle_motion import ObstacleMotion
from optiplan.planners.base import Budget
from optiplan.planners.cartesian.tool_path import line
from optiplan.planners.task.planned_steps import Pause, PlannedStep
from optiplan.planners.task.rides import riding
from optiplan.planners.task.rides.ride_path import RidePath, RideSection
from optiplan.planners.task.rides.riding import free_in_time
from optiplan.planners.task.stages import WorldState
from optiplan.planners.task.waiting import waiting
from optiplan.problem.load import problem_from_dict
from optiplan.trajectory.joining import standstill
from tests.checks import named
from tests.verify.tasks.test_ride_check import data_of, on_belt

READY = {"move": {"configuration": "ready"}}


def test_the_way_of_the_tool_has_the_derivatives_that_it_states():
    """Central differences of poses and twists, against the closed form with Coriolis' part."""
    turn = {"axis": [0, 0.6, 0.8], "angle": [0.2, 0.5, 0.1], "about": [0.3, 0.1, 0.2]}
    motion = ObstacleMotion.of_data([[0.1, 0.3, 0.02], [0, 0.1], [0]], None, turn)
    pin.seed(3)
    X, Y = pin.SE3.Random(), pin.SE3.Random()
    path = RidePath(motion, 0.7, [RideSection(line(X, Y), 0.8), RideSection(line(Y, Y), 0.4)])
    h = 1e-5
    for s in (0.1, 0.4, 0.9):
        a, b = path.pose(s - h), path.pose(s + h)
        turned = pin.log3(b.rotation @ a.rotation.T)
        twist = np.append(b.translation - a.translation, turned) / (2.0 * h)
        np.testing.assert_allclose(path.twist(s), twist, atol=1e-6)
        np.testing.assert_allclose(path.twist_rate(s), (path.twist(s + h) - path.twist(s - h)) / (2.0 * h), atol=1e-5)


def test_the_conveyor_of_the_examples_is_picked_from(problems, example):
    assert len((problems / "56_conveyor_pick.yaml").read_text().splitlines()) <= 40
    run = example("56_conveyor_pick")
    problem = run.problem
    take, let_go = (one.begin for one in run.trajectory.segments if one.kind in ("attach", "detach"))
    hand = np.array(problem.robot.fk(run.trajectory(take)).position)
    assert hand[1] == pytest.approx(-0.7 + 0.3 * take, abs=0.03)
    v = problem.robot.jacobian(run.trajectory(take))[:3] @ run.trajectory(np.array([take]), 1)[0]
    assert v == pytest.approx([0, 0.3, 0], abs=1e-3)
    assert take < 2.5 < let_go


@pytest.mark.parametrize(
    ("speed", "y", "x", "words"),
    [
        (3.0, -3.0, 0.5, "at 3 m/s"),
        (0.5, 0.3, 0.5, "leaves the reach of the arm before it can be met"),
        (0.3, -0.6, 1.6, "is never within reach"),
    ],
)
def test_what_cannot_be_met_is_named_with_its_step(speed, y, x, words):
    run = op.plan(problem_from_dict(on_belt(speed, y, x)), budget=300.0)
    assert run.failure is not None
    assert run.failure.kind in ("reach", "limits")
    assert words in run.failure.detail
    assert run.failure.witness["step"] in (1, 2, 3)


def test_the_arm_waits_while_it_goes_along():
    task = on_belt()["task"]
    task[3] = {"wait_until": "belt.y > -0.05"}
    run = op.plan(problem_from_dict(on_belt(0.1, -0.3, task=task)), budget=300.0)
    assert run.verified, run.failure or run.report.failures
    waited = next(one for one in run.trajectory.segments if one.kind == "wait_until")
    assert waited.end == pytest.approx(2.5, abs=1e-3)
    assert waited.end > waited.begin


@pytest.mark.parametrize(
    ("steps", "ends"),
    [
        (["cart.y > -0.9"], [0.001]),
        (["cart.y > -0.9", "attach"], [0.001, 0.001]),
        (["cart.y > -0.79", "attach", "cart.y > -0.78"], [0.1, 0.1, 0.2]),
    ],
)
def test_waits_that_are_over_and_events_alone_take_no_time(steps, ends):
    cart = op.Box("cart", size=(0.1, 0.1, 0.1), position=(0.5, -0.8, 0.1)).moving([[0], [0, 0.1], [0]])
    cube = op.Box("cube", size=(0.03, 0.03, 0.03), position=(0.2, 0.6, 0.1))
    task = op.Task()
    for one in steps:
        task = task.attach("cube", "panda_hand") if one == "attach" else task.wait_until(one)
    run = op.plan(op.Problem("panda", "ready", task=task, scene=[cart, cube]), budget=60.0)
    assert run.verified, run.failure or run.report.failures
    assert [one.end for one in run.trajectory.segments] == pytest.approx(ends, abs=1e-4)


def test_a_condition_that_no_longer_holds_when_the_arm_is_there_is_named():
    """A problem with a condition that holds at first can be read; the arm is there at 0.5 s at the earliest."""
    cart = op.Box("cart", size=(0.1, 0.1, 0.1), position=(0.5, -0.8, 0.1)).moving([[0], [0, 0.1], [0]])
    task = op.Task().move(op.JointGoal([0.9, -0.785, 0, -2.356, 0, 1.571, 0.785])).wait_until("cart.y < -0.79")
    before = op.plan(op.Problem("panda", "ready", task=task, scene=[cart]), budget=60.0)
    along = on_belt()
    along["task"].insert(3, {"wait_until": "belt.y < -0.5"})
    for run, step in ((before, 2), (op.plan(problem_from_dict(along), budget=60.0), 4)):
        assert run.failure.kind == "no-path", run.failure
        assert "y < -0." in run.failure.detail
        assert "does not hold at" in run.failure.detail
        assert run.failure.witness["step"] == step


def test_torques_that_a_slower_pace_keeps_are_kept(monkeypatch):
    """The first pace is said to take too much torque at all times and places."""
    known, durations = riding.first_within_limits, []

    def first_within_limits(problem, motions):
        (motion,) = motions
        durations.append(motion.duration)
        return known(problem, [motion]) if motion.duration > 1.2 * durations[0] else None

    monkeypatch.setattr(riding, "first_within_limits", first_within_limits)
    run = op.plan(problem_from_dict(on_belt(0.1, -0.3)), budget=60.0)
    assert run.verified, run.failure or run.report.failures


def test_a_move_that_only_meets_something_is_followed_by_another():
    """The second section of the task begins with the motion of the first."""
    over = {"move": {"pose": {"in": "belt", "position": [0, 0, 0.2], "rpy_deg": [180, 0, 0]}}}
    run = op.plan(problem_from_dict(on_belt(task=[over, over, READY])), budget=60.0)
    assert run.verified, run.failure or run.report.failures
    assert [one.kind for one in run.trajectory.segments] == ["move"] * 3


def test_what_has_stopped_before_the_arm_can_be_there_is_met():
    belt = data_of({"polynomial": [[0], [0, 0.3], [0]], "until": 0.5}, [0.5, 0.15, 0.1])
    run = op.plan(problem_from_dict(belt), budget=60.0)
    assert run.verified, run.failure or run.report.failures
    assert run.trajectory.segments[0].end > 0.5


def test_a_budget_that_ends_while_a_motion_is_checked_is_no_collision():
    problem = problem_from_dict(on_belt())
    step, state = problem.task[0], WorldState(problem.start, problem.scene)
    still = standstill(problem.robot.joint_names, problem.start, 1.0)
    assert free_in_time(problem, problem.scene, step, still, 0.0, Budget(60.0)) is None
    ride = free_in_time(problem, problem.scene, step, still, 0.0, Budget(0.0))
    pause = waiting(problem, [Pause(PlannedStep(step, state, state), 1.0)], Budget(0.0))
    assert (ride.kind, pause.kind) == ("budget", "budget")


def swing(angle):
    return {"move": {"joints": [angle, -0.785, 0, -2.356, 0, 1.571, 0.785]}}


def chosen(*alternatives, scene=()):
    task = [{"either": [list(one) for one in alternatives]}, READY]
    data = {"version": 1, "robot": "panda", "start": {"configuration": "ready"}, "task": task}
    return problem_from_dict(data | {"scene": {"obstacles": list(scene)}})


def test_the_quickest_alternative_is_taken_and_named():
    run = op.plan(chosen([swing(1.5), {"dwell": 0.1}], [swing(0.4)], [swing(-0.8)]), budget=300.0)
    assert run.verified
    assert [one.step for one in run.trajectory.segments] == [3, 5]
    assert any("alternative 2 of 3" in one for one in run.report.scope)
    told = run.info["either"]
    assert [one["alternatives"] for one in told] == [[1], [2], [3]]
    assert min(told, key=lambda one: one["duration"])["alternatives"] == [2]
    check = named(run.report, "either")
    assert check.covers == ("task.either[0]",)


def test_an_alternative_that_cannot_be_done_is_left():
    far = {"move": {"pose": {"position": [2.0, 0, 0.5]}}}
    run = op.plan(chosen([far], [swing(1.5)]), budget=300.0)
    assert run.verified
    assert "goal-unreachable" in run.info["either"][0]["failure"]
    none = op.plan(chosen([far], [far, {"dwell": 0.1}]), budget=300.0)
    assert none.failure is not None
    assert "none of 2 alternatives" in none.failure.detail


def test_a_motion_of_two_alternatives_is_refused():
    run = op.plan(chosen([swing(0.4)], [swing(-0.4)]), budget=300.0)
    other = op.plan(problem_from_dict({**run.problem.source, "task": [swing(0.4), swing(-0.4), READY]}), budget=300.0)
    report = op.verify(run.problem, other.trajectory)
    assert {"either", "steps"} <= {check.name for check in report.failures}
