"""The way that a driver keeps: the law for a while, then the stop, on the path and within limits, to a stand."""

import numpy as np
import pytest

import optiplan as op

LEAD = 0.06


def at(executor, seconds):
    for _ in range(round(1e3 * seconds)):
        executor.tick(1e-3)
    return executor


@pytest.mark.parametrize("place", [0.0, 0.1, 0.3, 0.5, 0.7, 0.79])
def test_it_goes_on_and_stops_on_the_path(run_of, place):
    run = run_of("01_reach")
    executor = at(op.Executor(run), place)
    ahead, limits = executor.ahead(LEAD), run.problem.limits
    assert ahead.t[0] == executor.time
    assert (np.diff(ahead.t) > 0.0).all()
    assert ahead.turn >= executor.time + LEAD - 1e-12
    assert np.abs(ahead.v[-1]).max() < 1e-9
    path = run.trajectory(np.linspace(0.0, run.duration, 20_000))
    for q in ahead.q[::5]:
        assert np.abs(path - q).max(axis=1).min() < 1e-4
    assert (np.abs(ahead.v) <= limits.velocity * 1.001).all()
    assert (np.abs(ahead.a) <= limits.acceleration * 1.001).all()
    jerk = np.abs(np.diff(ahead.a, axis=0)) / np.diff(ahead.t)[:, None]
    assert (jerk <= limits.jerk * 1.001).all()
    for one in ahead.t[ahead.t < ahead.turn][1:]:  # until then it is what the executor does
        tick = executor.tick(one - executor.time)
        assert np.allclose(tick.q, ahead.q[ahead.t == one][0], atol=1e-12)


def test_a_robot_that_stands_has_a_way_of_rising_times(run_of):
    """Without a lead all of them were one."""
    assert (np.diff(op.Executor(run_of("01_reach"), override=0.0).ahead(0.0).t) > 0.0).all()


def test_an_executor_follows_the_stop_that_its_robot_began(run_of):
    executor = at(op.Executor(run_of("01_reach")), 0.3)
    ahead = executor.ahead(LEAD)
    assert executor.is_along(ahead)
    executor.tick(ahead.turn - executor.time)
    executor.follow(ahead, "nothing came")
    assert not executor.is_along(ahead)
    for k in range(int(np.searchsorted(ahead.t, ahead.turn)), len(ahead.t)):
        tick = executor.tick(ahead.t[k] - executor.time)
        assert np.allclose(tick.q, ahead.q[k], atol=1e-12)
        assert np.allclose(tick.v, ahead.v[k], atol=1e-9)
    assert (executor.status.phase, executor.status.reason) == ("stopped", "nothing came")


def test_a_robot_that_stands_still_stays(run_of):
    executor = at(op.Executor(run_of("01_reach")), 0.3)
    executor.pause()
    at(executor, 0.5)
    assert executor.status.phase == "paused"
    ahead = executor.ahead(LEAD)
    assert np.ptp(ahead.q, axis=0).max() == 0.0
    assert np.abs(ahead.v).max() == 0.0
