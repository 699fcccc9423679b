"""`Execution`: commands from other threads, reports, and drivers that fail."""

import sys
import threading
import time
from itertools import pairwise

import numpy as np
import pytest

import optiplan as op
from optiplan.errors import InputError
from optiplan.execution.drivers.base import Capabilities, DriverError
from optiplan.execution.measurement import Measurement
from optiplan.execution.paths import proved_path
from optiplan.execution.scene import scene_watch
from tests.execution.in_process import FollowingRobot, SetClock, executed, steps_within_limits
from tests.waiting import wait_until

FAILS_AT = 250


@pytest.fixture
def run(run_of):
    return run_of("01_reach")


@pytest.fixture
def slow(run):
    """A robot at half the speed, in a time that goes on slowly enough for commands."""
    robot = FollowingRobot(run, rate=100.0, clock=SetClock(pause=0.005))
    execution = op.Execution(op.Executor(run, override=0.5), robot, clock=robot.clock)
    execution.start()
    yield execution
    execution.stop()
    execution.wait(20.0)


def test_commands_are_taken_at_the_next_tick(slow):
    wait_until(lambda: slow.snapshot()["place"] > 0.1)
    slow.pause()
    wait_until(lambda: slow.snapshot()["phase"] == "paused")
    place = slow.snapshot()["place"]
    slow.reverse()
    wait_until(lambda: slow.snapshot()["speed"] < 0.0)
    slow.resume()
    slow.override(0.8)
    wait_until(lambda: slow.snapshot()["place"] > place)
    assert slow.snapshot()["override"] == 0.8
    slow.stop("enough")
    found = slow.wait(20.0)
    assert (found["phase"], found["reason"], found["over"]) == ("stopped", "enough", True)


def test_a_command_that_is_being_made_at_the_start_ends_before_the_first_set_point(run, monkeypatch):
    executor, robot, begun, release = op.Executor(run), FollowingRobot(run), threading.Event(), threading.Event()
    execution = op.Execution(executor, robot, clock=robot.clock)
    monkeypatch.setattr(executor, "update_scene", lambda *_: begun.set() or release.wait(20.0))
    threads = [threading.Thread(target=execution.update_scene, args=({},)), threading.Thread(target=execution.start)]
    threads[0].start()
    assert begun.wait(20.0)
    threads[1].start()
    threads[1].join(0.1)
    sent = len(robot.ticks)
    release.set()
    for thread in threads:
        thread.join(20.0)
    assert sent == 0
    assert execution.wait(20.0)["phase"] == "done"


def test_a_wrong_command_ends_in_a_stop(slow):
    slow.override(float("nan"))
    assert "expected a speed from 0 to 1" in slow.wait(20.0)["reason"]


@pytest.mark.parametrize("command", ["override", "update_scene"])
def test_no_command_raises(slow, command):
    getattr(slow, command)(object())
    assert slow.wait(20.0)["phase"] == "stopped"


def test_another_motion_takes_over(run, slow):
    """The path of the other motion is prepared here, and handed over at a tick."""
    wait_until(lambda: slow.snapshot()["place"] > 0.1)
    slow.pause()
    wait_until(lambda: slow.snapshot()["phase"] == "paused")
    state = slow.state_in(0.0)
    home = op.plan(run.problem.with_start(op.State(state.q)).with_goal(run.problem.start), budget=1.0)
    assert slow.splice(home)
    slow.resume()
    slow.override(1.0)
    found = slow.wait(20.0)
    assert (found["phase"], found["reason"]) == ("done", "")
    assert np.allclose(found["q"], run.problem.start)
    with pytest.raises(DriverError, match="is over"):
        slow.state_in(0.1)
    assert not slow.splice(home)


def test_the_thread_of_set_points_prepares_nothing_of_another_motion(run, monkeypatch):
    """Not even where a third one is prepared meanwhile."""
    names = []

    def noted(call):
        def noting(*given, **options):
            names.append((call.__name__, threading.current_thread().name))
            return call(*given, **options)

        return noting

    monkeypatch.setattr(proved_path, "ClearanceLeft", noted(proved_path.ClearanceLeft))
    monkeypatch.setattr(scene_watch, "_PartWatch", noted(scene_watch._PartWatch))
    robot = FollowingRobot(run, rate=100.0, clock=SetClock(pause=0.005))
    executor = op.Executor(run, tracking=op.TrackingPolicy(least_clearance=0.0))
    prepare, third = executor.prepare_path, proved_path.ProvedPath(run, "test")
    monkeypatch.setattr(executor, "prepare_path", lambda path: (prepare(path), prepare(third))[0])
    execution = op.Execution(executor, robot, clock=robot.clock)
    execution.update_scene({"ball": op.Sphere("ball", 0.05, position=(2.0, 0.0, 0.5))})
    execution.start()
    wait_until(lambda: execution.snapshot()["place"] > 0.1)
    execution.pause()
    wait_until(lambda: execution.snapshot()["phase"] == "paused")
    names.clear()
    assert execution.splice(op.plan(run.problem.with_start(execution.state_in(0.0)), budget=1.0))
    assert {name for name, _ in names} == {"ClearanceLeft", "_PartWatch"}
    execution.resume()
    assert execution.wait(20.0)["phase"] == "done"
    assert {thread for _, thread in names} == {threading.current_thread().name}


def test_a_run_that_cannot_take_over_ends_in_a_stop(slow):
    assert not slow.splice(None)
    assert "that was to take over: " in slow.wait(20.0)["reason"]


def test_subscribers_get_states_and_the_end(run):
    robot, got, bad = FollowingRobot(run, rate=100.0, clock=SetClock(pause=0.01)), [], []
    execution = op.Execution(op.Executor(run), robot, clock=robot.clock)

    def broken(message):
        bad.append(message)
        raise RuntimeError("a reader")

    execution.subscribe(got.append)
    execution.subscribe(broken)
    execution.subscribe(bad.append)()  # ended at once
    execution.start()
    execution.wait(20.0)
    wait_until(lambda: got and got[-1]["kind"] == "end")
    assert len(bad) == 1
    states = [one for one in got if one["kind"] == "state"]
    assert 3 < len(states) < 100
    assert all(a["t"] < b["t"] for a, b in pairwise(states))
    assert set(states[0]) == {*execution.snapshot(), "kind"}


def test_events_of_a_task_are_reported():
    """Also one at the very start, and in a tick that came late."""
    scene = op.Scene([op.Box("cube", size=(0.04, 0.04, 0.04), position=(0.0, 0.0, 1.5))])
    task = op.Task().attach("cube", "wrist_3_link").move([0.2, -1.4, 1.4, -1.5, -1.5, 0.0]).detach("cube")
    run = op.plan(op.Problem("ur5", [0.0, -1.5, 1.5, -1.5, -1.5, 0.0], scene=scene, task=task), budget=3.0)
    assert run.verified
    robot, got = FollowingRobot(run, lead=0.06, clock=SetClock({int(1e3 * run.duration): 0.05})), []
    execution = op.Execution(op.Executor(run), robot, clock=robot.clock, patience=0.1)
    execution.subscribe(got.append)
    execution.start()
    found = execution.wait(30.0)
    assert [(one["kind"], one["object"]) for one in found["events"]] == [("attach", "cube"), ("detach", "cube")]
    wait_until(lambda: got and got[-1]["kind"] == "end")
    assert [one["event"] for one in got if one["kind"] == "event"] == found["events"]
    assert found["phase"] == "done"


def failing(run, call, error, rate=1000.0):
    class Failing(FollowingRobot):
        def _fail(self):
            if len(self.ticks) >= FAILS_AT:
                raise error

        def state(self):
            if call == "state":
                self._fail()
            return super().state()

        def send(self, tick):
            if call == "send":
                self._fail()
            super().send(tick)

    return Failing(run, rate)


def test_a_driver_that_takes_no_set_point_is_stopped(run):
    robot = failing(run, "send", OSError("cable out"))
    found = executed(run, robot).snapshot()
    assert (found["phase"], found["speed"]) == ("stopped", 0.0)
    assert found["reason"] == "the driver takes no set-point: OSError: cable out"
    assert robot.stopped == [found["reason"]]


def test_a_driver_that_loses_its_state_stops_along_the_path(run):
    robot = failing(run, "state", DriverError("no packet from the robot"))
    found = executed(run, robot).snapshot()
    assert (found["phase"], found["reason"]) == ("stopped", "the driver has no state: no packet from the robot")
    assert len(robot.ticks) > FAILS_AT + 50
    assert steps_within_limits(robot.ticks, 1e-3, run.problem.limits)


def hanging(run):
    """A robot that does not return from `send` until its `release` is set."""

    class Hanging(FollowingRobot):
        release = threading.Event()

        def send(self, tick):
            super().send(tick)
            if len(self.ticks) == FAILS_AT:
                self.release.wait(20.0)

    return Hanging(run)


@pytest.mark.parametrize("call", ["send", "state", "stop"])
def test_a_driver_that_would_end_its_thread_does_not_end_in_silence(run, call):
    robot = failing(run, call, SystemExit(3))
    if call == "stop":
        robot.stop = lambda _: sys.exit(3)
    found = executed(run, robot).snapshot()
    assert (found["phase"], found["over"]) == ("stopped", True)
    assert "SystemExit: 3" in found["reason"]
    if call == "state":
        assert steps_within_limits(robot.ticks, 1e-3, run.problem.limits)


def test_a_call_that_does_not_return_is_the_end_of_the_driver(run):
    robot = hanging(run)
    execution = op.Execution(op.Executor(run), robot, clock=robot.clock)
    execution.start()
    found = execution.wait(10.0)
    robot.release.set()
    assert (found["phase"], found["over"]) == ("stopped", True)
    assert "did not return" in found["reason"]
    time.sleep(0.05)
    assert len(robot.ticks) == FAILS_AT
    assert robot.stopped == [found["reason"]]


def test_a_stop_that_fails_is_reported(run):
    class Stuck(FollowingRobot):
        def stop(self, reason):
            raise OSError("brake")

    assert executed(run, Stuck(run)).snapshot()["reason"] == "done; its stop failed: OSError: brake"


def test_a_bug_in_the_loop_stops_the_driver(run, monkeypatch):
    robot = FollowingRobot(run)
    monkeypatch.setattr(op.Executor, "tick", lambda *_: 1 / 0)
    found = executed(run, robot).snapshot()
    assert "the loop failed: ZeroDivisionError" in found["reason"]
    assert robot.stopped == [found["reason"]]


def test_a_robot_that_stands_elsewhere_is_not_started(run):
    robot = FollowingRobot(run)
    robot.q = robot.q + np.array([0.0, 0.1, 0.0, 0.0, 0.0, 0.0, 0.0])
    got, execution = [], op.Execution(op.Executor(run), robot)
    execution.subscribe(got.append)
    with pytest.raises(DriverError, match=r"panda_joint2 is at -0\.6850, where -0\.7850 is expected"):
        execution.start()
    assert execution.over
    assert robot.ticks == []
    assert robot.stopped == ["not started"]
    wait_until(lambda: got)
    assert (got[0]["kind"], got[0]["phase"], got[0]["over"]) == ("end", "stopped", True)
    assert "does not stand where the motion begins" in execution.snapshot()["reason"]


@pytest.mark.parametrize("turns", [1.0, -2.0])
@pytest.mark.parametrize("lead", [0.0, 0.06])
def test_an_endless_joint_goes_on_in_the_turn_in_which_it_stands(endless_run, turns, lead):
    robot, turned = FollowingRobot(endless_run, lead=lead), 2.0 * np.pi * turns
    robot.q = robot.q + turned
    found = executed(endless_run, robot).snapshot()
    assert (found["phase"], found["reason"]) == ("done", "")
    q = np.array([tick.q for tick in robot.ticks])
    np.testing.assert_allclose(q[[0, -1], 0], [0.1 + turned, 1.5 + turned], atol=1e-6)
    assert np.abs(np.diff(q, axis=0)).max() < 2.0 * 1e-3 * 1.01
    for tick in robot.ticks:
        assert tick.ahead is None or abs(tick.ahead.q - tick.q).max() < 1.5
    assert found["q"] == pytest.approx([1.5])
    assert found["measured"] == pytest.approx([1.5], abs=0.01)


def test_a_joint_with_limits_is_not_taken_for_one_in_another_turn(run):
    robot = FollowingRobot(run)
    robot.q = robot.q + 2.0 * np.pi * np.eye(7)[6]
    with pytest.raises(DriverError, match="does not stand where the motion begins: panda_joint7"):
        op.Execution(op.Executor(run), robot).start()


@pytest.mark.parametrize("age", [None, 1.0])
def test_a_robot_whose_state_is_not_known_is_not_started(run, monkeypatch, age):
    class Silent(FollowingRobot):
        def state(self):
            return None if age is None else Measurement(self.q, 0.0 * self.q, 0.0, age)

    monkeypatch.setattr("optiplan.execution.loop.execution.FIRST_STATE", 0.05)
    with pytest.raises(DriverError, match="no new state"):
        op.Execution(op.Executor(run), Silent(run)).start()


def test_how_old_an_update_of_the_scene_is_reaches_the_executor(run):
    rule = op.Separation("person", reaction=0.1, intrusion=0.1, sensor_uncertainty=0.0, robot_uncertainty=0.0)
    execution = op.Execution(op.Executor(run, separation=rule), FollowingRobot(run))
    execution.update_scene({"person": None}, age=0.3)
    assert execution.snapshot()["reason"] == "the last data about 'person' are 0.300 s old"


def test_wrong_arguments_are_named(run):
    robot = FollowingRobot(run)
    with pytest.raises(InputError, match=r"op\.Execution: executor.*op\.Executor"):
        op.Execution(run, robot)
    with pytest.raises(InputError, match=r"rate: found the float 5000\.0; expected 10 to 2000 Hz"):
        op.Execution(op.Executor(run), robot, rate=5000.0)
    with pytest.raises(InputError, match="patience"):
        op.Execution(op.Executor(run), robot, patience=0.5)
    execution = op.Execution(op.Executor(run), robot)
    for value in (-1.0, float("nan"), "soon", True):
        with pytest.raises(InputError, match=r"op\.Execution\.wait: timeout: found"):
            execution.wait(value)
    for call, name in ((execution.subscribe, "callback"), (execution.lateness, "last")):
        with pytest.raises(InputError, match=f"{name}: found the int -3"):
            call(-3)
    robot.names = robot.names[::-1]
    with pytest.raises(InputError, match=r"driver: found a driver 'following' of the joints panda_joint7"):
        op.Execution(op.Executor(run), robot)


def test_it_runs_once(run):
    execution = executed(run, FollowingRobot(run))
    with pytest.raises(DriverError, match="started before"):
        execution.start()
    execution.override(0.5)  # nothing happens any more
    assert execution.snapshot()["override"] == 1.0
    assert execution.lateness()["max"] < 1e-9


def test_a_subscriber_that_does_not_return_hides_no_driver_that_hangs(run):
    release, robot = threading.Event(), hanging(run)
    execution = op.Execution(op.Executor(run), robot, clock=robot.clock)
    execution.subscribe(lambda _: release.wait(20.0))
    execution.start()
    found = execution.wait(5.0)
    release.set()
    robot.release.set()
    assert found["over"]
    assert "did not return" in found["reason"]


@pytest.mark.parametrize("error", [RuntimeError("a reader"), SystemExit(3)])
def test_a_subscriber_that_ends_and_raises_keeps_nothing_from_the_others(run, error):
    robot, got = FollowingRobot(run, rate=100.0, clock=SetClock(pause=0.005)), []
    execution = op.Execution(op.Executor(run), robot, clock=robot.clock)

    def once(_):
        end()
        raise error

    end = execution.subscribe(once)
    execution.subscribe(got.append)
    execution.start()
    execution.wait(20.0)
    wait_until(lambda: got and got[-1]["kind"] == "end")
    assert len(got) > 3


@pytest.mark.parametrize("timeout", [float("inf"), 1e12])
def test_it_is_waited_for_as_long_as_can_be_said(run, timeout):
    execution = op.Execution(op.Executor(run), FollowingRobot(run), clock=SetClock())
    execution.start()
    assert execution.wait(timeout)["over"]


def test_an_execution_that_was_refused_does_not_start_later(run):
    robot = FollowingRobot(run)
    robot.q = robot.q + 0.1
    execution = op.Execution(op.Executor(run), robot, clock=robot.clock)
    with pytest.raises(DriverError, match="does not stand"):
        execution.start()
    robot.q = np.array(run.trajectory.start)
    with pytest.raises(DriverError, match="started before"):
        execution.start()  # it is over, and takes no commands: nobody could stop it
    assert robot.ticks == []


def test_a_robot_is_compared_with_where_its_executor_is(run):
    executor, robot = op.Executor(run), FollowingRobot(run)
    for _ in range(300):
        executor.tick(1e-3)
    executor.pause()
    while executor.status.phase != "paused":
        tick = executor.tick(1e-3)
    with pytest.raises(DriverError, match="does not stand where the motion begins"):
        op.Execution(executor, robot).start()
    robot.q = tick.q
    execution = op.Execution(executor, robot, clock=robot.clock)
    execution.resume()
    execution.start()
    assert execution.wait(20.0)["phase"] == "done"


def test_a_robot_that_stands_is_not_sent_along_a_motion_that_begins_at_speed(run):
    executor, robot = op.Executor(run), FollowingRobot(run)
    for _ in range(300):
        robot.q = executor.tick(1e-3).q
    with pytest.raises(DriverError, match=r"begins with panda_joint\d at .*expected one from rest"):
        op.Execution(executor, robot).start()
    assert robot.ticks == []


def test_a_signal_may_stop_an_execution_while_its_thread_gives_a_command(run):
    execution = op.Execution(op.Executor(run), FollowingRobot(run))

    def handler():  # of a signal: it runs in the thread that gives a command
        with execution._lock:
            execution.stop()

    thread = threading.Thread(target=handler, daemon=True)
    thread.start()
    thread.join(5.0)
    assert not thread.is_alive()


@pytest.mark.parametrize(
    ("field", "value"),
    [("latency", np.nan), ("latency", np.inf), ("latency", -1.0), ("lead", np.nan), ("lead", 100.0), ("rate", "fast")],
)
def test_capabilities_that_cannot_be_are_refused(run, field, value):
    """With a latency that is no number a motion never ended; ways ahead of an endless lead had no numbers."""
    with pytest.raises(InputError, match=rf"op\.Capabilities: {field}: found"):
        Capabilities(**{"name": "mine", "joint_names": ("a",), "rate": 100.0, field: value})


def test_capabilities_without_text_or_truth_values_are_refused():
    for field, value in (("name", None), ("name", 3), ("joint_names", None), ("joint_names", "ab"), ("measures", "no")):
        with pytest.raises(InputError, match=field):
            Capabilities(**{"name": "mine", "joint_names": ("a",), "rate": 100.0, field: value})


def test_what_is_no_driver_is_refused(run):
    executor, robot = op.Executor(run), FollowingRobot(run)
    for driver in (None, run, object()):
        with pytest.raises(InputError, match=r"driver: found .* without 'capabilities'"):
            op.Execution(executor, driver)
    robot.capabilities = lambda: None
    with pytest.raises(InputError, match=r"expected one that returns an op\.Capabilities"):
        op.Execution(executor, robot)
    robot.capabilities = lambda: 1 / 0
    with pytest.raises(DriverError, match="does not say what it can do: ZeroDivisionError"):
        op.Execution(executor, robot)


@pytest.mark.parametrize("state", [np.zeros(7), (1.0, 2.0), "here", op.State(np.zeros(7))], ids=lambda one: type(one))
def test_a_state_that_is_no_measurement_ends_in_a_stop(run, state):
    robot = FollowingRobot(run)
    robot.state = lambda: state
    with pytest.raises(DriverError, match=r"state\(\) returned .*; expected an op\.Measurement, or None"):
        op.Execution(op.Executor(run), robot).start()
    later = FollowingRobot(run)
    states = later.state
    later.state = lambda: state if len(later.ticks) > FAILS_AT else states()
    found = executed(run, later).snapshot()
    assert found["phase"] == "stopped"
    assert "state() returned" in found["reason"]
    assert steps_within_limits(later.ticks, 1e-3, run.problem.limits)


@pytest.mark.parametrize("lead", [0.05, 0.1, 0.4])
def test_the_slowest_rate_of_a_driver_with_a_lead_runs_to_the_end(run, lead):
    """At 10 to 20 Hz a lead of 0.1 s was over before the next set-point, which was told as none coming."""
    slowest = max(10.0, 3.0 / lead)
    for rate in (slowest, 1.1 * slowest, 1.34 * slowest):
        robot = FollowingRobot(run, rate, lead)
        assert executed(run, robot).snapshot()["reason"] == ""
    if slowest > 10.0:
        with pytest.raises(InputError, match="at least 3 set-points in the driver's lead"):
            op.Execution(op.Executor(run), FollowingRobot(run, lead=lead), rate=0.9 * slowest)


@pytest.mark.parametrize("lead", [0.0, 0.3])
def test_a_loop_of_10_hz_has_ticks_of_the_longest_length(run, lead):
    """Times of the loop differ by 0.1 s but for rounding, which was told as a step of more than 0.1 s."""
    robot = FollowingRobot(run, 10.0, lead)
    execution = op.Execution(op.Executor(run, override=0.1), robot, clock=robot.clock)
    execution.start()
    assert execution.wait(20.0)["reason"] == ""
    assert len(robot.ticks) > 70


def test_lateness_can_be_read_while_ticks_come(run):
    """A state of a server has it, 25 times a second."""
    execution, over = op.Execution(op.Executor(run), FollowingRobot(run)), threading.Event()
    late, before = execution._loop.lateness, sys.getswitchinterval()

    def ticks():
        while not over.is_set():
            late.append(1e-3)

    thread = threading.Thread(target=ticks)
    sys.setswitchinterval(1e-6)
    try:
        thread.start()
        assert all(execution.lateness(100)["max"] <= 1e-3 for _ in range(300))
    finally:
        over.set()
        thread.join()
        sys.setswitchinterval(before)
