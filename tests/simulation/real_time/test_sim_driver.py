"""The driver `sim`: a process in real time that follows, measures, and whose death is seen."""

import os
import signal
import time

import numpy as np
import pytest

import optiplan as op
from optiplan.errors import InputError, OptiPlanError
from tests.planned import planned_until
from tests.waiting import wait_until

PATIENCE = 0.1
"""s, of a machine that is busy with other tests."""


@pytest.fixture(scope="module")
def run():
    run = planned_until(op.load_problem("01_reach"))
    assert run.verified
    return run


def started(run, **options):
    driver = op.driver("sim", run, rate=100.0, **options)
    execution = op.Execution(op.Executor(run, override=0.5), driver, patience=PATIENCE)
    execution.start()
    return driver, execution


@pytest.mark.parametrize("engine", ["mujoco", "own"])
def test_it_follows_a_motion(run, engine):
    if engine == "mujoco":
        pytest.importorskip("mujoco")
    driver, execution = started(run, engine=engine)
    found = execution.wait(20.0)
    if found["phase"] == "done":  # and no other process had the machine for 0.1 s
        assert np.allclose(found["measured"], run.trajectory.end, atol=1e-3)
        assert driver.report["error_rms"] < 0.02
    assert driver.report["contacts"] == []
    with pytest.raises(ProcessLookupError):
        os.kill(driver.pid, 0)


def test_a_process_that_is_killed_is_seen_at_once(run):
    driver, execution = started(run, engine="ideal")
    wait_until(lambda: execution.snapshot()["place"] > 0.1)
    os.kill(driver.pid, signal.SIGKILL)
    began = time.monotonic()
    found = execution.wait(10.0)
    assert (found["phase"], found["over"]) == ("stopped", True)
    assert "the process of the simulation ended by signal 9" in found["reason"]
    assert time.monotonic() - began < 1.0


def test_a_process_without_set_points_stops_along_its_path_and_ends(run):
    """What the robot does where our own program dies."""
    driver = op.driver("sim", run, rate=100.0, engine="ideal")
    executor = op.Executor(run)
    due, last, ahead = time.monotonic(), None, None
    for k in range(30):
        tick = executor.tick(0.01 if k else 0.0)
        if k % 3 == 0:
            ahead = executor.ahead(0.1)
            tick = op.Tick(tick.t, tick.q, tick.v, tick.a, tick.torque, (), tick.status, ahead)
        driver.send(tick)
        due += 0.01
        time.sleep(max(0.0, due - time.monotonic()))
    assert np.abs(tick.v).max() > 0.3
    seen = []
    wait_until(lambda: seen.append(driver.state()) or np.abs(seen[-1].v).max() < 1e-6)
    assert np.allclose(seen[-1].q, ahead.q[-1], atol=1e-3)
    path = run.trajectory(np.linspace(0.0, run.duration, 4000))
    for state in seen:
        last = np.abs(path - state.q).max(axis=1).min()
        assert last < 0.02
    driver.stop("")
    driver.stop("")


def test_a_process_that_hangs_ends_in_a_stop(run):
    driver, execution = started(run, engine="ideal")
    wait_until(lambda: execution.snapshot()["place"] > 0.1)
    os.kill(driver.pid, signal.SIGSTOP)
    found = execution.wait(20.0)
    assert (found["phase"], found["over"]) == ("stopped", True)
    assert "old" in found["reason"] or "same for" in found["reason"]
    with pytest.raises(ProcessLookupError):
        os.kill(driver.pid, 0)


def test_what_cannot_be_is_named(run, monkeypatch):
    with pytest.raises(InputError, match="engine: found the str 'bullet'; expected one of: mujoco, own, ideal"):
        op.driver("sim", run, engine="bullet")
    with pytest.raises(InputError, match="rate"):
        op.driver("sim", run, rate=0.0)
    monkeypatch.setattr("optiplan.simulation.plants.mujoco_plant.find_spec", lambda name: None)
    with pytest.raises(OptiPlanError, match=r"optiplan\[sim\]"):
        op.driver("sim", run, engine="mujoco")
