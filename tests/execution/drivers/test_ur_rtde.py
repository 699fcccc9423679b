"""The driver `ur_rtde` against a controller that speaks RTDE."""

import socket
import threading

import numpy as np
import pytest

import optiplan as op
from optiplan.errors import InputError, OptiPlanError
from optiplan.execution.drivers import ur_rtde
from optiplan.execution.drivers.base import DriverError
from tests.execution.drivers.ur_controller import SERVOJ, STOP_PROGRAM, WATCHDOG, ControllerProcess
from tests.waiting import wait_until

pytest.importorskip("rtde_control")
pytestmark = pytest.mark.usefixtures("urgent")


@pytest.fixture(scope="module")
def run():
    run = op.plan(op.Problem("ur5", [0.0, -1.5, 1.5, -1.5, -1.5, 0.0], [0.6, -1.2, 1.2, -1.5, -1.5, 0.3]), "quintic")
    assert run.verified
    return run


@pytest.fixture
def moving(run):
    """Begin the motion and wait for a place of it; return the robot and the execution.

    A machine that is busy with other tests may be late by 0.1 s, which ends a motion: then another is begun.
    """
    robots = []

    def begin(place, override):
        for _ in range(6):
            robots.append(ControllerProcess(run.trajectory.start))
            driver = op.driver("ur_rtde", run, host=robots[-1].host, rate=125.0)
            execution = op.Execution(op.Executor(run, override=override), driver, patience=0.1)
            execution.start()
            wait_until(lambda: execution.snapshot()["place"] >= place or execution.snapshot()["over"])  # noqa: B023
            if execution.snapshot()["place"] >= place:
                return robots[-1], execution
            robots[-1].kill()
        raise AssertionError(execution.snapshot()["reason"])

    yield begin
    for robot in robots:
        robot.kill()


def test_a_motion_arrives(run, moving):
    robot, execution = moving(run.duration, 1.0)
    found = execution.wait(20.0)
    assert (found["phase"], found["reason"]) == ("done", "")
    seen = robot.seen()
    assert np.allclose(seen["q"], run.trajectory.end)
    sent = [one for one in seen["commands"] if one[0] == SERVOJ]
    assert len(sent) == pytest.approx(125.0 * found["t"], abs=5 + found["missed"])
    assert sent[0][9:12] == [1.0 / 125.0, 0.1, 300.0]
    path = run.trajectory(np.linspace(0.0, run.duration, 4000))
    assert max(np.abs(path - one[1:7]).max(axis=1).min() for one in sent) < 1e-3
    assert [one[0] for one in seen["commands"] if one[0] in (WATCHDOG, STOP_PROGRAM)] == [WATCHDOG, STOP_PROGRAM]
    assert not seen["running"]


@pytest.mark.parametrize(
    ("name", "value", "reason"),
    [
        ("slider", 0.5, "scales its speed to 50%"),
        ("slider", float("nan"), "scales its speed to nan%"),
        ("safety", 1 + 4, "in a protective stop"),
        ("running", False, "takes no set-points"),
    ],
)
def test_a_robot_that_does_otherwise_ends_in_a_stop(run, moving, name, value, reason):
    robot, execution = moving(0.1, 0.5)
    robot.set(name, value)
    found = execution.wait(20.0)
    assert found["phase"] == "stopped"
    assert reason in found["reason"]
    assert found["place"] < run.duration


def test_a_robot_that_is_gone_ends_in_a_stop(moving):
    robot, execution = moving(0.1, 0.5)
    robot.process.kill()
    found = execution.wait(20.0)
    assert (found["phase"], found["over"]) == ("stopped", True)
    assert found["reason"]


def test_what_cannot_be_is_named(run, monkeypatch):
    with pytest.raises(InputError, match=r"host: found the str ''; expected the name or address of the robot"):
        op.driver("ur_rtde", run)
    with pytest.raises(InputError, match=r"gain: found the float 5000\.0; expected a number from 100 to 2000"):
        op.driver("ur_rtde", run, host="127.0.0.1", gain=5000.0)
    with pytest.raises(DriverError, match=r"no robot at 127\.0\.0\.1"):
        op.driver("ur_rtde", run, host="127.0.0.1")
    monkeypatch.setattr(ur_rtde, "find_spec", lambda name: None)
    with pytest.raises(OptiPlanError, match=r"optiplan\[ur\]"):
        op.driver("ur_rtde", run, host="127.0.0.1")


@pytest.mark.parametrize(
    ("answer", "reason"),
    [
        (b"", "no answer within 0.2 s"),
        (b"\0\4", "no answer within 0.2 s"),
        (b"\0\4V\0", "does not agree to version 2 of RTDE"),
        (b"SSH-2.0-OpenSSH_9.2\r\n", "does not agree to version 2 of RTDE"),
        (None, "does not agree to version 2 of RTDE"),
    ],
)
def test_what_stalls_or_speaks_otherwise_is_no_robot(run, monkeypatch, answer, reason):
    """The client would wait for ever, with Python's lock."""
    with socket.create_server(("127.0.0.1", 0)) as listening:
        monkeypatch.setattr(ur_rtde, "PORT", listening.getsockname()[1])
        monkeypatch.setattr(ur_rtde, "ANSWERS_IN", 0.2)
        peer = threading.Thread(target=answering, args=(listening, answer))
        peer.start()
        with pytest.raises(DriverError, match=reason):
            op.driver("ur_rtde", run, host="127.0.0.1")
        peer.join()


def answering(listening, answer):
    connection, _ = listening.accept()
    with connection:
        assert connection.recv(16) == ur_rtde.ASK
        if answer is not None:
            connection.sendall(answer)
            connection.recv(16)  # until the other side ends


def test_an_arm_of_other_joints_is_refused(run_of):
    with pytest.raises(InputError, match="a robot of 7 joints; expected an arm of 6 joints"):
        op.driver("ur_rtde", run_of("01_reach"), host="127.0.0.1")
