"""The policy `replan`: another motion takes over in time, or the robot takes its proved stop."""

import numpy as np
import pytest

import optiplan as op
from optiplan.execution.scene import planning_process
from tests.execution.flying import DT, executed, flying


@pytest.fixture(scope="module", autouse=True)
def patient():
    """Plans are not cut short on a busy machine; the clock of the executor is not that of the wall."""
    before, planning_process.IN_TIME = planning_process.IN_TIME, 100.0
    yield
    planning_process.IN_TIME = before


@pytest.fixture(scope="module")
def run(run_of):
    return run_of("01_reach")


def test_another_motion_takes_over_without_a_stop(run):
    ball, velocity = flying(run)
    executor, ticks, least = executed(run, op.Policy("replan", latency=0.06), ball, velocity)
    assert executor.status.phase == "done"
    assert executor.run is not run
    assert executor.run.verified
    assert least > 0.0
    assert executor.time < 1.3 * run.duration
    assert min(np.abs(tick.v).max() for tick in ticks[20:400]) > 0.1
    v, a = (np.array([getattr(tick, key) for tick in ticks]) for key in ("v", "a"))
    assert (np.abs(np.diff(a, axis=0)) <= run.problem.limits.jerk * DT * (1 + 1e-5) + 1e-6).all()
    assert (np.abs(np.diff(v, axis=0) - 0.5 * DT * (a[1:] + a[:-1])) < 1e-3).all()
    np.testing.assert_allclose(ticks[-1].q, run.trajectory.end, atol=1e-6)


def test_a_plan_that_is_late_leads_to_the_stop_and_to_a_motion_from_rest(run):
    standing = flying(run, place=0.6)[0](0.6 * run.duration)
    policy = op.Policy("replan", latency=0.05)
    executor, ticks, least = executed(run, policy, lambda t: standing, np.zeros(3), late=0.1)
    assert least > 0.0
    speeds = np.array([np.abs(tick.v).max() for tick in ticks])
    assert (speeds[150:-1] == 0.0).any()
    assert executor.status.phase == "done"
    assert executor.run is not run


def test_a_process_that_ends_stops_the_robot(run):
    executor = op.Executor(run, policy="replan")
    for _ in range(100):
        executor.tick(DT)
    executor._planning.close()
    for _ in range(5):
        tick = executor.tick(DT)
    assert tick.status.phase == "stopping"
    assert "process" in tick.status.reason


def test_a_run_past_vias_is_not_planned_anew(run_of):
    with pytest.raises(op.InputError, match="a run of vias"):
        op.Executor(run_of("22_via_spline"), policy="replan")
