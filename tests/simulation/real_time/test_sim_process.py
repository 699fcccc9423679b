"""The simulated robot without its clock: it follows, takes and releases what a task says, and reports."""

import subprocess
import sys

import numpy as np
import pytest

import optiplan as op
from optiplan.simulation.real_time.messages import Packet, ahead_packet, connected, data_of, data_packet, received
from optiplan.simulation.real_time.sim_process import CYCLE, RealTime, Setup, SimulatedRobot

START = [0.0, -1.5, 1.5, -1.5, -1.5, 0.0]


@pytest.fixture(scope="module")
def task():
    """A cube is taken in the air, carried, and released there."""
    scene = op.Scene([op.Box("cube", size=(0.04, 0.04, 0.04), position=(0.0, 0.0, 1.5))])
    steps = op.Task().attach("cube", "wrist_3_link").move([0.2, -1.4, 1.4, -1.5, -1.5, 0.0]).detach("cube")
    run = op.plan(op.Problem("ur5", START, scene=scene, task=steps), budget=3.0)
    assert run.verified
    return run


def setup_of(run, engine):
    return Setup(run.problem, run.trajectory, engine, 20.0, 0.0, 0.006)


@pytest.mark.parametrize("engine", ["own", "ideal"])
def test_a_task_is_followed_with_its_objects(task, engine):
    robot, motion = SimulatedRobot(setup_of(task, engine)), task.trajectory
    t = np.arange(0.0, motion.duration, CYCLE)
    q, v, a = (motion(t, order) for order in range(3))
    for k in range(len(t)):
        robot.cycle(q[k], v[k], a[k], float(t[k]))
    assert robot.t == pytest.approx(len(t) * CYCLE)
    assert np.abs(robot.plant.q - motion.end).max() < 2e-3
    assert robot.touched == set()
    if engine == "own":
        assert list(robot.objects()) == ["cube"]
        assert robot.objects()["cube"] < 2e-3


def test_a_report_has_what_a_person_wants_to_know(task):
    ours, theirs = connected()
    with ours, theirs:
        loop = RealTime(theirs, setup_of(task, "ideal"))
        ours.send(Packet.STOP.value)
        loop.run()
        theirs.send(data_packet(Packet.REPORT, loop.report()))
        packets = received(ours)
    kinds = [kind for kind, _ in packets]
    assert kinds[0] is Packet.STATE
    report = data_of(packets[-1][1])
    assert (report["contacts"], report["error_max"], report["interval_std"]) == ([], 0.0, None)


def test_what_fails_is_told_to_the_driver_and_to_nobody_else():
    ours, theirs = connected()
    with ours, theirs:
        command = [sys.executable, "-m", "optiplan.simulation.real_time.sim_process", str(theirs.fileno())]
        done = subprocess.run(
            command, pass_fds=[theirs.fileno()], input=b"no setup", capture_output=True, timeout=60, check=False
        )
        ((kind, content),) = received(ours)
    assert (done.returncode, done.stderr) == (1, b"")
    assert kind is Packet.FAILED
    assert data_of(content).startswith("UnpicklingError: ")


def test_packets_stay_whole(task):
    ahead = op.Executor(task).ahead(0.1)
    ours, theirs = connected()
    with theirs:
        ours.send(ahead_packet(ahead))
        ours.send(Packet.STOP.value)
        ours.close()
        (kind, content), (last, _) = received(theirs)
        assert (kind, last) == (Packet.AHEAD, Packet.STOP)
        assert len(content) == 8 * (1 + 19 * len(ahead.t))
        with pytest.raises(ConnectionError):
            received(theirs)
