"""A task among obstacles that move: its steps let them pass, and the proof knows where they are when."""

import threading

import pinocchio as pin
import pytest

import optiplan as op
from optiplan.planners.base import Budget
from optiplan.planners.task import planner
from optiplan.runs.pipeline import run

AWAY = [0.9, -0.3, 0.0, -2.2, 0.0, 1.9, 0.8]
STEPS = [{"move": {"joints": AWAY}}, {"dwell": 0.2}, {"move": {"configuration": "ready"}}]
WAY = (0.38, 0.25, 0.5)
"""m: the hand passes here on its way."""


def sweeping(since, until):
    """A ball that falls past, and is in the way of the hand between two times, s."""
    middle, rate = 0.5 * (since + until), 1.2
    ball = op.Sphere("ball", 0.12, position=(WAY[0], WAY[1], WAY[2] + rate * middle))
    return ball.moving([[0], [0], [0, -rate]], until=2.0 * middle + 0.5)


def task(*obstacles, steps=STEPS):
    return op.Problem("panda", "ready", scene=list(obstacles), task=list(steps))


@pytest.fixture(scope="module")
def alone():
    found = op.plan(task(), budget=20.0)
    assert found.verified
    return found


@pytest.fixture(scope="module")
def met():
    return op.plan(task(sweeping(0.1, 0.9)), budget=20.0)


def test_a_task_lets_an_obstacle_pass(met, alone):
    assert met.verified, (met.failure, met.report)
    assert met.info["waited"] > 0.0
    assert met.duration > alone.duration + 0.05
    assert [segment.kind for segment in met.trajectory.segments] == ["move", "dwell", "move"]


def test_a_motion_that_does_not_wait_is_refused_with_the_time(met, alone):
    refused = op.verify(met.problem, alone.trajectory).failures
    assert [check.name for check in refused] == ["collision"]
    assert 0.0 < refused[0].time < alone.duration
    assert "ball" in refused[0].place


def test_steps_that_are_not_joined_yet_wait(met, monkeypatch):
    """The search is cancelled while steps are joined: what was delayed before is the answer."""
    cancel, join = threading.Event(), planner.join_steps

    def join_steps(*args, **keys):
        cancel.set()
        return join(*args, **keys)

    monkeypatch.setattr(planner, "join_steps", join_steps)
    found = run(met.problem, "trajopt", {}, Budget(60.0, cancel), lambda stage, fraction: None)
    assert found.verified, (found.failure, found.report)
    assert found.info["waited"] > 0.0


def test_the_proof_is_about_the_time_of_each_step(alone):
    """An obstacle that comes on the way back meets the arm then, not on the way there."""
    last = alone.trajectory.segments[-1]
    report = op.verify(task(sweeping(last.begin, last.end)), alone.trajectory)
    (refused,) = [check for check in report.failures if check.name == "collision"]
    assert refused.time > last.begin


def test_what_stands_in_its_way_for_good_is_named():
    """It comes to where the arm stands at the end of its first step, and waits there."""
    end = op.plan(task(steps=STEPS[:1]), budget=20.0).trajectory.end
    place = hand(end)
    ball = op.Sphere("ball", 0.1, position=(place[0], place[1] + 3.0, place[2])).moving(
        [[0], [0, -1.0], [0]], until=3.0
    )
    found = op.plan(task(ball, steps=[STEPS[0], {"dwell": 4.0}]), budget=20.0)
    assert found.failure is not None
    assert found.failure.kind == "collision"
    assert "ball" in found.failure.detail
    assert found.failure.witness["step"] == 2


def test_what_has_come_to_stand_is_in_the_way_of_later_steps(alone):
    """It stops on the way back before the arm begins it; nothing moves any more by then."""
    last = alone.trajectory.segments[-1]
    place = hand(alone.trajectory(0.5 * (last.begin + last.end)))
    ball = op.Sphere("ball", 0.05, position=(*place[:2], place[2] + 3.0)).moving([[0], [0], [0, -6.0]], until=0.5)
    found = op.plan(task(ball, steps=[STEPS[0], {"dwell": 1.0}, STEPS[2]]), budget=10.0)
    assert found.failure is not None, found.report
    assert found.failure.kind == "collision"
    assert "'ball'" in found.failure.detail
    assert found.failure.witness["step"] == 3


def test_what_moves_cannot_be_taken_by_an_arm_that_rests():
    with pytest.raises(op.InputError, match=r"'ball', which moves, while the arm does not go with it"):
        task(sweeping(0.1, 0.9), steps=[{"attach": {"object": "ball", "link": "panda_hand"}}])


def hand(q):
    robot = op.load_robot("panda")
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, q)
    return data.oMf[robot.frame_id("panda_hand")].translation.copy()
