"""The policy `replan`: another motion takes over in time, or the robot takes its proved stop."""

import re
from dataclasses import replace
from threading import Event
from types import SimpleNamespace

import numpy as np
import pytest

import optiplan as op
from optiplan.cores import WHY_DEAD
from optiplan.execution.scene import planning_process
from optiplan.problem.problem import derived
from tests.execution.flying import DT, executed, flying
from tests.waiting import wait_until


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


def test_another_motion_keeps_the_clearance_of_the_executor(run):
    standing = flying(run, place=0.5)[0](0.5 * run.duration)
    policy = op.Policy("replan", latency=0.06)
    executor, _, least = executed(run, policy, lambda t: standing, np.zeros(3), clearance_of=0.04)
    assert executor.status.phase == "done"
    assert executor.run is not run
    assert least > 0.04


def test_a_process_that_gets_no_motion_stops_the_robot_and_ends(run, caplog):
    executor = op.Executor(run, policy="replan")
    for _ in range(100):
        executor.tick(DT)
    planning = executor._planning
    planning._pipe = SimpleNamespace(send=lambda message: 1 / 0)
    planning.follow(run, executor._scene.watch)
    wait_until(lambda: planning.lost)
    for _ in range(5):
        tick = executor.tick(DT)
    assert tick.status.phase == "stopping"
    assert "process" in tick.status.reason
    assert "nothing can be sent to the planning process: ZeroDivisionError" in caplog.text
    executor.close()
    assert not planning._process.is_alive()


def test_a_process_that_ends_at_once_tells_of_scripts_without_a_guard(run, monkeypatch):
    monkeypatch.setattr(planning_process, "_idle", [])
    monkeypatch.setattr(planning_process, "serve", id)  # which returns
    with pytest.raises(op.OptiPlanError, match=re.escape(f"ended at once: {WHY_DEAD}")):
        op.Executor(run, policy="replan")


def test_a_reply_to_an_older_motion_does_not_let_it_ask(run):
    executor, done = op.Executor(run, policy="replan"), Event()
    planning = executor._planning

    class Overtaken(Event):
        """The robot follows another motion just before this is set; the process does not get that yet."""

        def set(self):
            if not done.is_set():
                planning._sending.acquire()
                planning.follow(run, executor._scene.watch)
            super().set()
            done.set()

    planning._ready = Overtaken()
    planning.follow(run, executor._scene.watch)
    wait_until(done.is_set)
    planning.seek(executor._law, 0.0, executor._state_at, executor._scene)
    asked = planning._asked
    planning._sending.release()
    executor.close()
    assert asked is None


def test_after_a_splice_it_plans_to_the_goal_of_that_run(run):
    executor = op.Executor(run, policy=op.Policy("replan", latency=0.06))
    planning = executor._planning
    for _ in range(200):
        executor.tick(DT)
    goal = op.JointGoal(run.trajectory.end + np.array([0.5, 0.0, 0.3, 0.0, 0.0, 0.0, 0.0]))
    second = op.plan(run.problem.with_goal(goal).with_start(executor.state_in(0.05)), budget=1.0)
    assert executor.splice(second)
    position = tuple(run.problem.robot.fk(second.trajectory(0.7 * second.duration)).matrix[:3, 3])
    with planning._sending:  # the process does not know the run yet when the only update comes
        while executor.run is not second:
            executor.tick(DT)
        executor.update_scene({"ball": op.Sphere("ball", 0.06, position=position)})
    assert planning._ready.wait(20.0)
    for k in range(6000):
        if k % 20 == 0:
            wait_until(lambda: planning._asked is None or planning._done)
        tick = executor.tick(DT)
        if tick.status.phase == "done":
            break
    executor.close()
    assert executor.run is not second
    np.testing.assert_allclose(tick.q, second.trajectory.end, atol=1e-6)


def test_a_run_past_vias_does_not_take_over_where_it_could_not_be_planned_anew(run, run_of):
    executor = op.Executor(run, policy="replan")
    vias = derived(run.problem, vias=run_of("22_via_spline").problem.vias)
    assert not executor.splice(replace(run, problem=vias))
    executor.close()
    assert executor.status.reason == "the motion that was to take over is a run of vias, which is not replanned"


def test_a_run_past_vias_is_not_planned_anew(run_of):
    with pytest.raises(op.InputError, match="a run of vias"):
        op.Executor(run_of("22_via_spline"), policy="replan")
