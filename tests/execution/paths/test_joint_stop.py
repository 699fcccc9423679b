"""Stops off the path: faster than along it, within all limits, clear; and the way back to the path."""

from dataclasses import replace

import numpy as np
import pytest

import optiplan as op
from optiplan.collision.model import CollisionModel
from optiplan.execution.paths.joint_stop import JointStops, quickest_stop, within_limits
from optiplan.execution.paths.path_laws import PathPlace, SetPoint
from optiplan.execution.paths.proved_path import ProvedPath
from optiplan.execution.scene.scene_watch import SceneWatch
from optiplan.execution.scene.seen_scene import SeenScene
from optiplan.problem.problem import derived

DT = 1e-3


def stopped(run, at, how="joints", **options):
    """An executor that was stopped at a time, s, and its ticks from then until it stands still."""
    executor = op.Executor(run, **options)
    before = [executor.tick(DT) for _ in range(round(at / DT))]
    executor.stop("test", how)
    ticks = [before[-1]]
    while executor.status.phase != "stopped" and len(ticks) < 3000:
        ticks.append(executor.tick(DT))
    return executor, ticks


def assert_within_limits(run, ticks):
    limits = run.problem.limits
    q, v, a, torque = (np.array([getattr(tick, key) for tick in ticks]) for key in ("q", "v", "a", "torque"))
    assert (q >= limits.lower).all()
    assert (q <= limits.upper).all()
    for values, limit in ((v, limits.velocity), (a, limits.acceleration), (torque, limits.torque)):
        assert (np.abs(values) <= limit * (1.0 + 2e-6)).all()
    assert (np.abs(np.diff(a, axis=0)) <= limits.jerk * DT * (1.0 + 2e-6) + 1e-9).all()
    np.testing.assert_allclose(np.diff(q, axis=0), 0.5 * DT * (v[1:] + v[:-1]), atol=2e-6)


@pytest.mark.parametrize(("name", "at"), [("01_reach", 0.3), ("01_reach", 0.62), ("09_ur5", 0.5), ("16_delbot", 2.0)])
def test_it_is_faster_than_along_the_path_and_leads_back(run_of, name, at):
    run = run_of(name)
    executor, ticks = stopped(run, at)
    _, along = stopped(run, at, "path")
    assert len(ticks) < len(along)
    assert executor.status.off_path
    away = np.abs(ticks[-1].q - run.trajectory(executor.status.place)).max()
    assert away > 1e-3
    executor.resume()
    while executor.status.phase != "done" and len(ticks) < 20_000:
        ticks.append(executor.tick(DT))
        if not executor.status.off_path:
            np.testing.assert_allclose(ticks[-1].q, run.trajectory(executor.status.place), atol=1e-9)
    assert executor.status.phase == "done"
    assert_within_limits(run, ticks)


def test_it_stays_clear_of_everything_at_its_clearance(run_of):
    run, left = run_of("02_shelf"), 0
    model = CollisionModel(run.problem.robot, run.problem.scene)
    obstacles = {one.name for one in run.problem.scene.obstacles}
    for at in np.linspace(0.1, 0.9, 12) * run.duration:
        executor, ticks = stopped(run, at, clearance=0.01)
        if not executor.status.off_path:
            continue
        left += 1
        for tick in ticks[::5]:
            near = model.contacts(tick.q, 0.01 - 1e-4)
            assert all(one.distance > 0.0 for one in near)
            assert not any({one.pair.name_a, one.pair.name_b} & obstacles for one in near)
    assert 0 < left < 12


def test_what_was_seen_beside_the_path_keeps_the_robot_on_it(run_of):
    reach = op.load_problem("01_reach")
    run = op.plan(reach.with_scene([op.Sphere("ball", radius=0.03, position=(2.0, 0.0, 0.5))]), budget=3.0)
    executor, ticks = stopped(run, 0.3)
    assert executor.status.off_path
    tool, rng = run.problem.robot.fk(ticks[-1].q).matrix[:3, 3], np.random.default_rng(0)
    for _ in range(200):  # a place that the stop would strike and the path does not
        ball = op.Sphere("ball", radius=0.03, position=tuple(tool + rng.uniform(-0.15, 0.15, 3)))
        if not CollisionModel(run.problem.robot, op.Scene([ball])).collides(ticks[-1].q):
            continue
        again = op.Executor(run)
        for _ in range(300):
            again.tick(DT)
        again.update_scene({"ball": op.Pose(tuple(ball.X_WO.translation))})
        if again.status.reason == "":
            break
    again.stop("test", "joints")
    assert not again.status.off_path
    assert again.status.phase == "stopping"


def test_the_way_back_can_be_stopped_and_gone_on_with(run_of):
    run = run_of("01_reach")
    executor, ticks = stopped(run, 0.4)
    executor.reverse()
    for k in range(6000):
        match k:
            case 60 | 900:
                executor.stop("again", "joints")
            case 300 | 1200:
                executor.resume()
            case 350:
                executor.pause()
            case 600:
                executor.override = 0.5
                executor.reverse()
        ticks.append(executor.tick(DT))
        if executor.status.phase == "done":
            break
    assert executor.status.phase == "done"
    assert_within_limits(run, ticks)


def test_stops_off_the_path_add_what_was_seen_to_their_scene_once(run_of):
    run = run_of("01_reach")
    executor = op.Executor(run)
    balls = {name: op.Sphere(name, 0.05, position=(2.0, y, 0.5)) for name, y in (("a", 0.0), ("b", 0.2))}
    executor.update_scene(balls)
    pairs = []
    for _ in range(4):
        for _ in range(100):
            executor.tick(DT)
        executor.stop("test", "joints")
        assert executor.status.off_path
        while executor.status.phase != "stopped":
            executor.tick(DT)
        pairs.append(executor._detour.stop.model.world.lower_bounds(executor.tick(0.0).q[None]).shape[1])
        executor.resume()
        while executor.status.off_path:
            executor.tick(DT)
    assert len(set(pairs)) == 1


def test_a_new_motion_takes_over_off_the_path(run_of):
    run = run_of("01_reach")
    executor, _ = stopped(run, 0.4)
    second = op.plan(run.problem.with_start(executor.state_in(0.0)), budget=2.0)
    assert executor.splice(second)
    executor.tick(DT)
    assert executor.run is second
    assert not executor.status.off_path


def test_obstacles_may_appear_on_the_stop_and_on_the_way_back(run_of):
    """Both are watched among the bodies of one world."""
    reach = op.load_problem("01_reach")
    run = op.plan(reach.with_scene([op.Sphere("ball", radius=0.03, position=(2.0, 0.0, 0.5))]), budget=3.0)
    executor = op.Executor(run)
    for _ in range(400):
        executor.tick(DT)
    executor.update_scene({"ball": op.Pose((2.0, 0.0, 0.6))})
    executor.stop("test", "joints")
    assert executor.status.off_path
    executor.resume()
    for k in range(4):
        name = f"box {k}"
        executor.update_scene({name: op.Box(name, (0.1, 0.1, 0.1 + 0.01 * k), position=(2.0 + 0.1 * k, 1.0, 1.0))})
        executor.override = 0.9 - 0.1 * k
        for _ in range(300):
            executor.tick(DT)
    assert executor.status.reason == ""
    assert not executor.status.off_path


@pytest.mark.parametrize("waits", [10, 40])
def test_no_policy_changes_a_stop_off_the_path(run_of, waits):
    executor = op.Executor(run_of("01_reach"), policy="slow")
    for _ in range(400):
        executor.tick(DT)
    executor.stop("test", "joints")
    assert executor.status.off_path
    for _ in range(waits):
        executor.tick(DT)
    executor.resume()
    tool = executor.run.problem.robot.fk(executor._detour.stop.laws.motion.end).matrix[:3, 3]
    executor.update_scene({"ball": op.Sphere("ball", 0.05, position=tuple(tool + np.array([0.0, 0.0, 0.15])))})
    assert executor.status.reason
    assert executor._law is executor._detour.law


def test_where_path_constraints_hold_it_stops_along_the_path(run_of):
    executor, _ = stopped(run_of("39_cup_upright"), 0.1)
    assert not executor.status.off_path
    assert executor.status.phase == "stopped"


def test_another_word_is_named(run_of):
    executor, _ = stopped(run_of("01_reach"), 0.3, "at once")
    assert executor.status.reason == "stop: found the str 'at once'; expected 'path' or 'joints'"
    assert not executor.status.off_path


def test_the_stop_of_joints_is_exact(run_of):
    limits = run_of("01_reach").problem.limits
    rng = np.random.default_rng(4)
    names = run_of("01_reach").trajectory.joint_names
    for _ in range(30):
        q = 0.5 * (limits.lower + limits.upper)
        v, a = rng.uniform(-0.7, 0.7, (2, 7)) * [limits.velocity, limits.acceleration]
        motion = quickest_stop(SetPoint(q, v, a, a, PathPlace(0.0, 1.0, 0.0)), limits, 1.0, names)
        for order, value in enumerate((q, v, a)):
            np.testing.assert_allclose(motion(0.0, order), value, atol=1e-9)
        for order in (1, 2):
            np.testing.assert_allclose(motion(motion.duration, order), 0.0, atol=1e-7)
        for order, limit in ((2, limits.acceleration), (3, limits.jerk)):
            low, high = motion.extrema(order)
            assert (np.maximum(-low, high) <= limit * (1.0 + 2e-6)).all()
        low, high = motion.extrema(0)
        kept = (low >= limits.lower).all() and (high <= limits.upper).all()
        low, high = motion.extrema(1)
        assert within_limits(motion, limits) <= (kept and (np.maximum(-low, high) <= limits.velocity).all())


def test_stops_beyond_the_limits_of_torque_are_refused(run_of):
    run = run_of("01_reach")
    path = ProvedPath(run, "test")
    law = path.forwards.laws.steady(0.4, 1.0, 0.0)
    assert JointStops(path).leave(path.forwards, law, 0.0, SeenScene(SceneWatch(path, 0.0))) is not None
    weak = np.abs(path.forwards.laws.set_point(law, 0.0).torque) * 1.001
    limits = replace(run.problem.limits, torque=weak)
    path.run = replace(run, problem=derived(run.problem, limits=limits))
    assert JointStops(path).leave(path.forwards, law, 0.0, SeenScene(SceneWatch(path, 0.0))) is None


@pytest.mark.parametrize(("name", "at"), [("01_reach", 0.55), ("01_reach", 0.65), ("09_ur5", 0.7), ("09_ur5", 1.05)])
def test_a_way_back_that_is_over_within_a_tick_leads_on_without_a_jump(run_of, name, at):
    """Stopped and resumed just before the path: rounding leaves a way back that is shorter than a tick."""
    run, fine = run_of(name), 1e-4

    def going_back(ticks):
        executor = stopped(run, at)[0]
        executor.resume()
        for _ in range(ticks):
            executor.tick(fine)
        return executor

    executor, ticks = going_back(0), 0
    while executor.tick(fine).status.off_path:
        ticks += 1
    executor = going_back(ticks - 20)
    executor.stop()
    before = executor.tick(fine)
    executor.resume()
    for _ in range(30):
        tick = executor.tick(DT)
        assert (np.abs(tick.a - before.a) <= run.problem.limits.jerk * DT * (1.0 + 1e-5) + 1e-6).all()
        before = tick
    assert not tick.status.off_path
