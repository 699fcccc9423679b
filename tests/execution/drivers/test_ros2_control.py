"""The driver `ros2_control` against a server that speaks rosbridge's protocol."""

import time

import numpy as np
import pytest

import optiplan as op
from optiplan.errors import OptiPlanError
from optiplan.execution.drivers import ros2_control
from optiplan.execution.drivers.base import DriverError

pytest.importorskip("roslibpy")
from tests.execution.drivers.rosbridge_server import Robot, Server
from tests.waiting import wait_until

pytestmark = pytest.mark.usefixtures("urgent")


@pytest.fixture
def run(run_of):
    return run_of("01_reach")


@pytest.fixture
def robot(run):
    robot = Robot(run.problem.robot.joint_names, np.array(run.trajectory.start))
    with Server(robot) as server:
        robot.port = server.port
        yield robot


def execution_of(run, robot, override=1.0, oldest=0.1):
    driver = op.driver("ros2_control", run, host="127.0.0.1", port=robot.port)
    executor = op.Executor(run, override=override, tracking=op.TrackingPolicy(oldest=oldest))
    return op.Execution(executor, driver, patience=0.1)


def from_path(run, seen):
    path = run.trajectory(np.linspace(0.0, run.duration, 4000))
    return max(np.abs(path - q).max(axis=1).min() for q in seen)


def test_a_motion_arrives_and_stays_on_its_path(run, robot, monkeypatch):
    monkeypatch.setattr(ros2_control, "LEAD", 3.0)  # on a busy machine a tick comes a second late
    execution = execution_of(run, robot, oldest=3.0)  # and a state, too
    execution.start()
    time.sleep(0.3)
    execution.override(0.5)
    found = execution.wait(30.0)
    assert (found["phase"], found["reason"]) == ("done", "")
    assert np.allclose(robot.at(robot.clock())[0], run.trajectory.end, atol=1e-6)
    assert np.allclose(found["measured"], run.trajectory.end, atol=0.05)
    assert from_path(run, robot.seen) < 0.01  # on a busy machine
    assert len(robot.goals) < 20
    assert not op.driver("ros2_control", run, host="127.0.0.1", port=robot.port).capabilities().tried_on_hardware


def test_without_us_the_robot_stops_on_its_path(run, robot):
    """Each goal ends in the proved stop: here our connection ends."""
    execution = execution_of(run, robot, override=0.5, oldest=3.0)
    execution.start()
    wait_until(lambda: execution.snapshot()["place"] > 0.15)
    execution._driver._ros.close()  # as a cable that is pulled
    found = execution.wait(20.0)
    assert found["phase"] == "stopped"
    assert "the connection to the rosbridge server is lost" in found["reason"]
    wait_until(lambda: robot.clock() > robot.t[-1])
    assert from_path(run, [*robot.seen, robot.q[-1]]) < 0.01
    assert not np.allclose(robot.q[-1], run.trajectory.end, atol=0.1)


@pytest.mark.parametrize(("fault", "reason"), [("scaling", "scales its speed to 50%"), ("refuse", "ABORTED: no")])
def test_a_robot_that_does_otherwise_ends_in_a_stop(run, robot, fault, reason):
    execution = execution_of(run, robot, override=0.5, oldest=3.0)
    execution.start()
    wait_until(lambda: execution.snapshot()["place"] > 0.1)
    setattr(robot, fault, 50.0 if fault == "scaling" else True)
    found = execution.wait(20.0)
    assert found["phase"] == "stopped"
    assert reason in found["reason"]


@pytest.mark.parametrize("leap", [10.0, -10.0, 0.3])
def test_goals_never_begin_by_a_clock_that_leapt(run, robot, leap):
    execution = execution_of(run, robot, override=0.5)
    execution.start()
    wait_until(lambda: execution.snapshot()["place"] > 0.1)
    robot.leap = leap
    found = execution.wait(20.0)
    assert found["phase"] == "stopped"
    assert "the stamps of joint states leapt from" in found["reason"]
    wait_until(lambda: robot.clock() > robot.t[-1])
    assert from_path(run, [*robot.seen, robot.q[-1]]) < 0.01
    assert max(robot.leads) < 0.11


def test_the_client_does_not_connect_again(run, robot):
    execution = execution_of(run, robot, override=0.5, oldest=3.0)
    execution._driver._ros.factory._reconnect_delay = 0.05
    execution.start()
    wait_until(lambda: execution.snapshot()["place"] > 0.1)
    robot.connections[0].close()
    assert "the connection to the rosbridge server is lost" in execution.wait(20.0)["reason"]
    time.sleep(0.5)
    assert len(robot.connections) == 1


def test_a_robot_that_stands_elsewhere_is_not_moved(run, robot):
    robot.q = robot.q + 0.1
    with pytest.raises(DriverError, match="does not stand where the motion begins"):
        execution_of(run, robot).start()
    assert robot.goals == []


@pytest.mark.parametrize(
    ("name", "value"),
    [("host", 5), ("host", " "), ("port", 0), ("port", 70000), ("port", "x"), ("controller", 3), ("states", None)],
)
def test_arguments_that_cannot_be_are_named(run, name, value):
    with pytest.raises(op.InputError, match=rf"op\.driver: {name}: found .*; expected a"):
        op.driver("ros2_control", run, **{name: value})


def test_what_is_missing_is_named(run, monkeypatch):
    monkeypatch.setattr(ros2_control, "CONNECTED_IN", 0.2)
    with pytest.raises(DriverError, match=r"no rosbridge server at 127\.0\.0\.1:9"):
        op.driver("ros2_control", run, host="127.0.0.1", port=9)
    monkeypatch.setattr(ros2_control, "find_spec", lambda name: None)
    with pytest.raises(OptiPlanError, match=r"optiplan\[ros\]"):
        op.driver("ros2_control", run)
