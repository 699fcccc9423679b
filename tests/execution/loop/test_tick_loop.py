"""What the loop does with late ticks, clocks that run backwards and drivers without a state, in a time that is set."""

from dataclasses import replace

import numpy as np
import pytest

import optiplan as op
from optiplan.errors import OptiPlanError
from optiplan.execution.loop.tick_loop import PATIENCE, SETTLE, in_words
from tests.execution.in_process import FollowingRobot, SetClock, executed, steps_within_limits

PERIOD = 1e-3
LEAD = 0.06
AT = 300
"""The tick that comes late, in full motion."""


@pytest.fixture
def run(run_of):
    return run_of("01_reach")


def late_run(run, delay, lead=0.0):
    robot = FollowingRobot(run, lead=lead, clock=SetClock({AT: delay}))
    return robot, executed(run, robot).snapshot()


def test_a_motion_comes_to_its_end_on_the_grid_of_its_rate(run):
    robot = FollowingRobot(run)
    found = executed(run, robot).snapshot()
    assert (found["phase"], found["reason"], found["missed"]) == ("done", "", 0)
    assert np.allclose(np.diff(robot.came), PERIOD)
    assert np.allclose([tick.t for tick in robot.ticks], PERIOD * np.arange(len(robot.ticks)))
    assert np.allclose(robot.q, run.trajectory.end)
    assert robot.came[-1] - robot.came[0] >= run.duration + SETTLE - 2 * PERIOD
    assert robot.stopped == ["done"]


class FreezingRobot(FollowingRobot):
    """Stands still from `last` s before the end on, for `during` s."""

    def __init__(self, run, last, during):
        super().__init__(run)
        self.frozen = (run.duration - last, run.duration - last + during)

    def send(self, tick):
        before = self.q
        super().send(tick)
        if self.frozen[0] < tick.t < self.frozen[1]:
            self.q = before


@pytest.mark.parametrize("last", [0.1, 0.2, 0.3])
def test_a_robot_that_does_not_come_to_the_end_is_not_done(run, last):
    """The lag alone does not show it: it is the distance that counts."""
    robot = FreezingRobot(run, last, 60.0)
    execution = executed(run, robot)
    found = execution.snapshot()
    assert found["phase"] == "stopped"
    assert "the robot does not come to the end of the motion: panda_joint1 is at" in found["reason"]
    assert robot.stopped == [found["reason"]]


def test_a_robot_that_comes_to_the_end_late_is_done(run):
    robot = FreezingRobot(run, 0.2, 0.7)
    found = executed(run, robot).snapshot()
    assert (found["phase"], robot.stopped) == ("done", [found["reason"] or "done"])
    assert np.allclose(robot.q, run.trajectory.end)


def test_a_robot_may_end_as_far_off_as_it_may_move(run):
    robot = FreezingRobot(run, 0.1, 60.0)
    execution = op.Execution(op.Executor(run, deviation=0.06), robot, clock=robot.clock)
    execution.start()
    assert execution.wait(20.0)["phase"] == "done"


@pytest.mark.parametrize("lead", [0.0, LEAD])
def test_a_tick_that_is_a_little_late_changes_nothing(run, lead):
    _, found = late_run(run, 0.9 * PATIENCE, lead)
    assert (found["phase"], found["reason"], found["missed"]) == ("done", "", 9)
    assert found["longest"] == pytest.approx(PERIOD + 0.9 * PATIENCE)


@pytest.mark.parametrize("delay", [0.0101, 0.03, 0.0999])
def test_single_set_points_go_on_one_period_after_the_last_to_a_stop(run, delay):
    """The robot waits for the next one: whenever it comes, it must not be a jump."""
    robot, found = late_run(run, delay)
    assert found["phase"] == "stopped"
    assert f"a set-point came {1e3 * delay:.0f} ms late" in found["reason"]
    assert found["missed"] == int(delay / PERIOD)
    assert steps_within_limits(robot.ticks, PERIOD, run.problem.limits)
    assert robot.ticks[AT].t - robot.ticks[AT - 1].t == pytest.approx(PERIOD)
    assert robot.ticks[-1].status.speed == 0.0
    assert robot.stopped == [found["reason"]]


def test_a_long_silence_ends_single_set_points_at_once(run):
    """Nobody knows where the drives left the robot: there is no set-point that would be no jump."""
    robot, found = late_run(run, 1.0)
    assert len(robot.ticks) == AT
    assert (found["phase"], found["speed"]) == ("stopped", 0.0)
    assert "no set-point for 1.0" in found["reason"]
    assert robot.stopped == [found["reason"]]


@pytest.mark.parametrize("delay", [0.0101, 0.1, 1.0])
def test_a_robot_with_a_way_ahead_is_found_where_it_went(run, delay):
    """After any silence the next set-point is where the robot is: on its way ahead, which ends in the proved stop."""
    robot, found = late_run(run, delay, LEAD)
    assert found["phase"] == "stopped"
    assert "ms" in found["reason"]
    before, after = robot.ticks[:AT], robot.ticks[AT]
    ahead = [tick.ahead for tick in before if tick.ahead is not None][-1]
    passed = PERIOD * round((robot.came[AT] - robot.came[AT - 1]) / PERIOD)
    assert after.t == pytest.approx(before[-1].t + passed, abs=1.01 * PERIOD)
    for j in range(len(after.q)):
        assert after.q[j] == pytest.approx(np.interp(after.t, ahead.t, ahead.q[:, j]), abs=1e-4)
    assert ahead.turn <= before[-1].t + 1.5 * LEAD
    assert steps_within_limits(robot.ticks[AT:], PERIOD, run.problem.limits)
    assert robot.ticks[-1].status.speed == 0.0


@pytest.mark.parametrize("delay", [0.03, 0.1])
@pytest.mark.parametrize("turns", [True, False])
def test_nothing_takes_over_while_a_robot_follows_its_way_ahead(run, delay, turns):
    """It knows of no other way, be it back or of another run: the next set-point is where it went."""
    executor = op.Executor(run)
    robot = FollowingRobot(run, lead=LEAD, clock=SetClock({AT: delay}))
    execution = op.Execution(executor, robot, clock=robot.clock)
    tick = executor.tick

    def asked(dt, measured=None):
        if turns and executor.time == pytest.approx(0.15):  # it would turn at 0.312 s
            executor.reverse()
        if not turns and executor.time == pytest.approx(0.28):
            assert executor.splice(op.plan(run.problem.with_start(executor.state_in(0.03)), budget=2.0))
        return tick(dt, measured)

    executor.tick = asked
    execution.start()
    execution.wait(30.0)
    before, after = robot.ticks[:AT], robot.ticks[AT]
    ahead = [one.ahead for one in before if one.ahead is not None][-1]
    went = [np.interp(after.t, ahead.t, q) for q in ahead.q.T]
    np.testing.assert_allclose(after.q, went, atol=1e-4)
    assert steps_within_limits(robot.ticks[AT:], PERIOD, run.problem.limits)


def test_a_way_ahead_is_renewed_before_its_stop_begins(run):
    robot = FollowingRobot(run, lead=LEAD)
    execution = op.Execution(op.Executor(run), robot, clock=robot.clock)
    execution.start()
    execution.wait(30.0)
    latest = None
    for tick in robot.ticks:
        latest = tick.ahead or latest
        assert latest is not None
        assert latest.t[0] <= tick.t <= latest.turn
    count = sum(tick.ahead is not None for tick in robot.ticks)
    assert count < len(robot.ticks) / 20


def test_a_clock_that_runs_backwards_ends_in_a_stop(run):
    robot, found = late_run(run, -0.5)
    assert found["phase"] == "stopped"
    assert "the clock ran backwards by 0.499" in found["reason"]
    assert steps_within_limits(robot.ticks, PERIOD, run.problem.limits)


def test_what_waits_gets_every_set_point_however_late(run):
    robot = FollowingRobot(run, clock=SetClock({AT: 5.0}))
    waiting = replace(robot.capabilities(), waits=True, measures=False)
    robot.capabilities = lambda: waiting
    assert executed(run, robot).snapshot()["phase"] == "done"
    assert np.allclose(np.diff([tick.t for tick in robot.ticks]), PERIOD)


def test_what_was_seen_grows_old_while_single_set_points_are_late(run):
    """Each is 8 ms late: the robot stops as soon after the last data as in time, and obstacles are where they are."""
    person = op.Cylinder("person", radius=0.3, length=1.8, position=(6.0, 0.0, 0.9))
    rule = op.Separation("person", reaction=0.1, intrusion=0.1, sensor_uncertainty=0.0, robot_uncertainty=0.0)
    executor = op.Executor(run, separation=rule)
    executor.update_scene({"person": person})
    robot = FollowingRobot(run, clock=SetClock(dict.fromkeys(range(1, 1000), 0.008)))
    execution = op.Execution(executor, robot, clock=robot.clock)
    send, ball, given = robot.send, op.Sphere("ball", 0.05, position=(3.0, 0.0, 0.5)), []

    def sends(tick):
        send(tick)
        if len(robot.ticks) == 3:
            given.append(robot.clock.now())
            velocity, seen = np.array([0.1, 0.0, 0.0]), {"ball": ball}
            execution.update_scene(seen, {"ball": velocity}, age=0.02)
            velocity[:], seen["ball"] = np.nan, None  # the caller may write into its own again
        if len(robot.ticks) == 60:
            execution.stop()

    robot.send = sends
    execution.start()
    execution.wait(30.0)
    old = next(k for k, tick in enumerate(robot.ticks) if "are 0." in tick.status.reason)
    assert 0.1 <= robot.came[old] - robot.came[0] < 0.1 + 0.01
    assert robot.came[-1] - robot.came[0] > 0.5
    (seen,) = executor._scene._obstacles.values()
    assert executor.time - seen.time == pytest.approx(robot.came[-1] - given[0] + 0.02, abs=1.01 * PERIOD)


def test_words_of_errors():
    assert in_words(OptiPlanError("the robot is off")) == "the robot is off"
    assert in_words(ValueError("no\n number")) == "ValueError: no number"
    assert in_words(KeyError()) == "KeyError"
