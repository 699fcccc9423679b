"""Policies: what a robot does where an obstacle blocks its path, judged by coal at every tick."""

import numpy as np
import pytest

import optiplan as op
from tests.execution.flying import DT, PERIOD, executed, flying


@pytest.fixture(scope="module")
def run(run_of):
    return run_of("01_reach")


@pytest.mark.parametrize("policy", ["wait", "slow"])
def test_a_ball_that_flies_by_is_not_met(run, policy):
    ball, velocity = flying(run)
    _, ticks, least = executed(run, op.Policy(policy, period=PERIOD * DT), ball, velocity)
    assert ticks[-1].status.phase == "done"
    assert least > 0.0
    assert "ball" in " ".join(tick.status.reason for tick in ticks)
    jerk = np.abs(np.diff([tick.a for tick in ticks], axis=0)) / DT
    assert (jerk <= run.problem.limits.jerk * (1 + 1e-5)).all()


def test_who_slows_down_gets_farther_than_who_waits_until_that_stands(run):
    ball, velocity = flying(run, speed=0.5, seed=1)
    policies = [op.Policy(reaction, period=PERIOD * DT) for reaction in ("slow", "wait")]
    slow, waiting = (way_of(executed(run, policy, ball, velocity)[1]) for policy in policies)
    stands = int(np.flatnonzero(np.diff(waiting[100:]) == 0.0)[0]) + 100
    assert 0.0 < waiting[stands] < 0.5 * waiting[-1]
    assert (slow[:stands] >= waiting[:stands] - 1e-9).all()
    assert slow[stands] > 1.2 * waiting[stands]
    assert slow[stands] > slow[stands - 1]


def way_of(ticks):
    """The way that the joints have gone at each tick, rad."""
    return np.abs(np.diff([tick.q for tick in ticks], axis=0)).sum(axis=1).cumsum()


def test_without_updates_a_slow_robot_stops(run):
    ball, velocity = flying(run)
    executor = op.Executor(run, policy="slow")
    for _ in range(100):
        executor.tick(DT)
    executor.update_scene({"ball": op.Sphere("ball", radius=0.06, position=tuple(ball(0.1)))}, {"ball": velocity})
    for _ in range(1000):
        tick = executor.tick(DT)
    assert (tick.status.phase, tick.status.speed) == ("waiting", 0.0)


def test_a_stop_does_not_wait_for_the_policy(run):
    ball, velocity = flying(run)
    executor = op.Executor(run, policy=op.Policy("slow", period=0.08))
    for _ in range(100):
        executor.tick(DT)
    executor.update_scene({"ball": op.Sphere("ball", radius=0.06, position=tuple(ball(0.1)))}, {"ball": velocity})
    assert executor.status.reason
    executor.stop("enough")
    for _ in range(20):
        tick = executor.tick(DT)
    assert tick.status.speed < 0.99
    assert (tick.status.phase, tick.status.reason) == ("stopping", "enough")


def test_the_policy_stop_waits_for_resume(run):
    ball, velocity = flying(run)
    executor, ticks, _ = executed(run, "stop", ball, velocity, most=2.0)
    assert ticks[-1].status.phase == "stopped"
    assert "ball" in ticks[-1].status.reason
    executor.update_scene({"ball": None})
    executor.resume()
    while executor.status.phase != "done":
        executor.tick(DT)


def test_the_end_is_not_taken_where_a_ball_is_about_to_strike_it(run):
    end = run.problem.robot.fk(run.trajectory.end).matrix[:3, 3]
    late = run.duration + 1.0
    ball, velocity = (lambda t: end + np.array([0.0, 0.0, 0.8 * (late - t)])), np.array([0.0, 0.0, -0.8])
    for linger, waits in ((0.0, False), (2.0, True)):
        executor = op.Executor(run, policy=op.Policy("wait", linger=linger))
        for _ in range(100):
            executor.tick(DT)
        executor.update_scene({"ball": op.Sphere("ball", radius=0.06, position=tuple(ball(0.1)))}, {"ball": velocity})
        assert (executor.status.reason != "") == waits


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda run: op.Policy("dodge"), "wait, stop, slow, replan"),
        (lambda run: op.Policy("slow", period=0.0), "seconds > 0"),
        (lambda run: op.Policy("replan", latency=np.nan), "seconds > 0"),
        (lambda run: op.Policy("wait", linger=-1.0), "seconds >= 0"),
        (lambda run: op.Executor(run, policy="dodge"), "an op.Policy, or one of"),
        (lambda run: op.Executor(run, policy=3), "an op.Policy, or one of"),
    ],
)
def test_what_is_no_policy(run, make, words):
    with pytest.raises(op.InputError, match=words):
        make(run)
