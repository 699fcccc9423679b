"""What an executor is asked at the wrong moment, or with values that cannot be: it keeps to what was proved."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

import optiplan as op
from optiplan.collision.model import CollisionModel
from optiplan.execution.paths.next_path import NextPath
from optiplan.execution.paths.path_laws import PathPlace
from optiplan.execution.paths.proved_path import ProvedPath
from optiplan.problem.problem import derived
from optiplan.problem.task.scene_change import carrying
from optiplan.problem.task.timeline import scene_parts

DT = 1e-3


def after(executor, ticks):
    for _ in range(ticks):
        tick = executor.tick(DT)
    return tick


def settled(executor, most=4000):
    """Tick until the robot stands still; return the ticks."""
    ticks = []
    while not ticks or (executor.status.speed != 0.0 and len(ticks) < most):
        ticks.append(executor.tick(DT))
    assert executor.status.speed == 0.0
    return ticks


def assert_continuous(run, ticks):
    a, v, q = (np.array([getattr(tick, key) for tick in ticks]) for key in ("a", "v", "q"))
    assert (np.abs(np.diff(a, axis=0)) <= run.problem.limits.jerk * DT * (1 + 1e-5) + 1e-6).all()
    np.testing.assert_allclose(np.diff(q, axis=0), 0.5 * DT * (v[1:] + v[:-1]), atol=2e-6)


@pytest.fixture(scope="module")
def spliced(run_of):
    """An executor at 0.2 s, with a run that is to take over 50 ms later."""
    run = run_of("01_reach")
    executor = op.Executor(run)
    after(executor, 200)
    return run, op.plan(run.problem.with_start(executor.state_in(0.05)), budget=2.0)


def pending(spliced):
    run, second = spliced
    executor = op.Executor(run)
    after(executor, 200)
    executor.state_in(0.05)
    assert executor.splice(second)
    return executor


@pytest.mark.parametrize(
    "ask", [lambda ex: setattr(ex, "override", 0.3), lambda ex: ex.pause(), lambda ex: ex.reverse()]
)
def test_a_change_of_speed_drops_a_run_that_was_to_take_over(spliced, ask):
    executor = pending(spliced)
    ticks = [executor.tick(DT) for _ in range(20)]
    ask(executor)
    assert "before another motion" in executor.status.reason
    ticks += settled(executor)
    assert_continuous(spliced[0], ticks)
    assert executor.run is spliced[0]
    assert executor.status.phase in ("stopped", "done")


@pytest.mark.parametrize("ask", [lambda ex: setattr(ex, "override", 0.3), lambda ex: ex.reverse()])
def test_a_change_of_speed_drops_a_motion_of_the_policy_and_the_robot_goes_on(spliced, ask):
    """It stopped for good, as with a run of `splice`, though nobody had asked for that motion."""
    executor = pending(spliced)
    executor._next = executor._next._replace(number=1)
    ask(executor)
    assert (executor._next, executor.status.reason) == (None, "")
    assert after(executor, 300).status.phase in ("running", "changing")
    assert executor.run is spliced[0]


def test_a_run_that_begins_in_motion_is_led_to_the_wanted_speed(spliced):
    _, second = spliced
    slow = op.Executor(second, override=0.3)
    assert after(slow, 400).status.speed in (0.3, 0.0)
    assert slow.status.place < second.duration
    held = op.Executor(second, override=0.0)
    settled(held)
    assert held.status.phase in ("paused", "done")


def test_there_is_no_way_back_to_a_start_in_motion(spliced):
    _, second = spliced
    executor = op.Executor(second)
    ticks = [executor.tick(DT) for _ in range(60)]
    executor.reverse()
    ticks += settled(executor)
    place = executor.status.place
    ticks += [executor.tick(DT) for _ in range(300)]
    assert executor.status.place == place > 0.0
    assert_continuous(second, ticks)


def test_a_run_that_ends_in_motion_is_refused(run_of):
    run = run_of("01_reach")
    c = run.trajectory.coefficients.copy()
    c[-1, 1] += 0.1
    with pytest.raises(op.InputError, match="ends in motion"):
        op.Executor(replace(run, trajectory=replace(run.trajectory, coefficients=c)))


def test_a_robot_at_rest_takes_another_run_whenever_it_comes(run_of):
    run = run_of("01_reach")
    executor = op.Executor(run)
    after(executor, 200)
    executor.pause()
    settled(executor)
    second = op.plan(run.problem.with_start(executor.state_in(0.01)), budget=2.0)
    place = after(executor, 300).q
    assert executor.splice(second)
    np.testing.assert_allclose(after(executor, 300).q, place, atol=1e-8)  # it is paused still
    assert executor.run is second
    assert executor.status.phase == "paused"
    executor.resume()
    assert after(executor, 100).status.speed > 0.5


def test_the_way_back_ends_at_the_last_event(run_of):
    run = run_of("40_panda_sorts_cubes")
    path = ProvedPath(run, "test")
    attach = next(event for event in path.events if event.kind == "attach")
    grip = next(event for event in path.events if event.kind == "gripper")
    assert path.backwards(attach.begin, attach.begin) is None  # it was just done
    assert path.backwards(attach.begin - 1e-13, attach.begin) is None
    back = path.backwards(grip.end + 0.2, grip.end + 0.2)
    assert back.start - back.laws.length == pytest.approx(grip.end, abs=1e-12)  # the gripper stays closed
    assert path.backwards(run.duration, run.duration).start == run.duration


def test_reverse_at_an_event_that_was_done_stays_there(run_of):
    run = run_of("40_panda_sorts_cubes")
    executor = op.Executor(run)
    grip = next(event for event in run.trajectory.segments if event.kind == "gripper")
    while executor.status.place < grip.end + 0.3:
        executor.tick(5e-3)
    executor.reverse()
    done = [event for tick in (executor.tick(5e-3) for _ in range(400)) for event in tick.events]
    assert executor.status.place == pytest.approx(grip.end, abs=1e-9)
    for ask in (executor.resume, executor.reverse, executor.resume, executor.reverse):
        ask()
        done += executor.tick(5e-3).events
    done += [event for tick in (executor.tick(5e-3) for _ in range(200)) for event in tick.events]
    assert executor.status.place >= grip.end - 1e-9
    assert done == []


def test_at_the_end_of_a_way_back_the_object_is_still_carried(run_of):
    """Rounding, or the mirrored path, must not put the robot before the event that is not undone."""
    run = run_of("40_panda_sorts_cubes")
    attach = next(event for event in run.trajectory.segments if event.kind == "attach")
    executor = op.Executor(run)
    while executor.status.place < attach.begin + 0.05:
        executor.tick(5e-3)
    executor.reverse()
    ticks = [executor.tick(5e-3) for _ in range(200)]
    assert attach.begin <= ticks[-1].status.place <= attach.begin + 1e-9
    carried = next(part for part in scene_parts(run.problem, run.trajectory) if part.begin >= attach.begin)
    robot = carrying(carried.problem.robot, carried.problem.scene)
    models, still = (robot.model, run.problem.robot.model), np.zeros(robot.n)
    wanted, empty = (pin.rnea(model, model.createData(), ticks[-1].q, still, still) for model in models)
    assert np.abs(wanted - empty).max() > 0.1
    np.testing.assert_allclose(ticks[-1].torque, wanted, atol=1e-6)


def test_events_before_another_run_takes_over_are_handed_out(run_of, monkeypatch):
    monkeypatch.setattr("optiplan.execution.law_follower.same_state", lambda *_: True)  # it begins elsewhere
    run = run_of("40_panda_sorts_cubes")
    executor = op.Executor(run)
    attach = next(event for event in run.trajectory.segments if event.kind == "attach")
    while executor.time < attach.begin - 0.03:
        executor.tick(0.01)
    second = op.Executor(run)._path
    executor._next = NextPath(attach.begin + 0.005, second)
    done = [event for tick in (executor.tick(0.1) for _ in range(3)) for event in tick.events]
    assert attach in done


class Hostile:
    def __array__(self, *_, **__):
        raise RuntimeError("no numbers")

    def __repr__(self):
        raise RuntimeError("no words")


NUMBERS = [10**400, 1j, np.complex128(1j), Hostile(), None, True, "soon", np.float64("inf"), [1.0]]


@pytest.mark.parametrize("value", NUMBERS, ids=lambda value: type(value).__name__)
def test_nothing_raises(run_of, value):
    executor = op.Executor(run_of("01_reach"), deviation=0.1)
    name = "nobody"
    for ask in (
        lambda: executor.tick(value),
        lambda: setattr(executor, "override", value),
        lambda: executor.update_scene({}, {}, value),
        lambda: executor.update_scene({name: value}),
        lambda: executor.update_scene(value),
        lambda: executor.splice(value),
    ):
        ask()
        assert executor.status.reason
        executor.resume()
    for reason, how in ((value, "path"), ("", value), ("", np.array([1, 2])), ("", ["joints"])):
        executor.stop(reason, how)
        executor.update_scene({"ball": op.Sphere("ball", 0.5)})  # the reason grows
        assert executor.status.reason
        executor.update_scene({"ball": None})
        executor.resume()
    for measured in (value, [value] * 7, np.full(7, 1j), Hostile()):
        if measured is not None:
            executor.tick(DT, measured)
            assert executor.status.reason
            executor.resume()


@pytest.mark.parametrize("name", ["01_reach", "16_delbot"])
def test_speeds_are_reached_from_anywhere(run_of, name):
    path = ProvedPath(run_of(name), "test")
    laws, duration = path.forwards.laws, path.motion.duration
    rng = np.random.default_rng(1)
    for _ in range(150):
        law, t = laws.steady(rng.uniform(0.0, 0.9 * duration), rng.choice([0.01, 1.0]), 0.0), 0.0
        for _ in range(4):
            target = float(rng.choice([0.0, 1e-6, 1e-3, 1e-2, rng.uniform(), 1.0 - 1e-6]))
            then = laws.change(PathPlace(*law.at(t)), t, target)
            if then is not None:
                assert then.target == target or then.at(then.settled)[0] >= duration
                assert then.at(then.settled)[0] >= duration or then.settled < t + 3.0
            law = then or law
            t += rng.uniform(0.0, max(law.settled - t, 0.01))


def test_a_stop_does_not_wait_for_a_weak_braking_to_end(run_of):
    path = ProvedPath(run_of("40_panda_sorts_cubes"), "test")
    for event in path.events:
        for place in np.linspace(event.begin, event.end, 200 if event.end > event.begin else 1):
            law = path.forwards.laws.change(PathPlace(float(place), 1.0, 0.0), 0.0, 1e-3)
            assert law is None or law.settled < 3.0, place


def next_from(executor, latency):
    """Let a motion from the state in `latency` s take over."""
    second = op.plan(executor.run.problem.with_start(executor.state_in(latency)), budget=2.0)
    assert executor.splice(second)


def test_no_run_takes_over_from_where_the_robot_turned(run_of):
    run = run_of("01_reach")
    executor = op.Executor(run)
    ticks = [executor.tick(DT) for _ in range(400)]
    executor.reverse()
    next_from(executor, executor._law.settled - executor.time + 0.1)  # at rest, where it was to stay
    ticks += [executor.tick(DT) for _ in range(600)]
    assert executor.run is run
    assert "before another motion" in executor.status.reason
    assert_continuous(run, ticks)


@pytest.mark.parametrize("pauses", [True, False])
def test_no_run_takes_over_from_a_way_back_that_was_left(run_of, pauses):
    run = run_of("01_reach")
    executor = op.Executor(run)
    ticks = [executor.tick(DT) for _ in range(400)]
    executor.stop("test", "joints")
    assert executor.status.off_path
    while executor.status.phase != "stopped":
        ticks.append(executor.tick(DT))
    executor.resume()
    ticks += [executor.tick(DT) for _ in range(100)]
    next_from(executor, 0.05 if pauses else executor._law.settled - executor.time + 0.1)
    ticks += [executor.tick(DT) for _ in range(20)]
    if pauses:
        executor.pause()
    ticks += [executor.tick(DT) for _ in range(800)]
    assert executor.run is run
    assert "before another motion" in executor.status.reason
    assert_continuous(run, ticks)


@pytest.fixture(scope="module")
def beside(run_of):
    """A run with a ball far away, and another one from its state at 0.25 s, to elsewhere."""
    ball = op.Sphere("ball", radius=0.05, position=(2.0, 0.0, 0.5))
    run = op.plan(run_of("01_reach").problem.with_scene([ball]), budget=3.0)
    executor = op.Executor(run)
    after(executor, 200)
    goal = op.JointGoal(run.trajectory.end + np.array([1.4, 0, 0.9, 0, 0, 0, 0]))
    return run, op.plan(run.problem.with_goal(goal).with_start(executor.state_in(0.05)), budget=2.0)


def seen_at(beside, t):
    """An executor at 0.2 s that has seen the ball where the tool of the second motion is at a time t, and its model."""
    run, second = beside
    executor = op.Executor(run)
    after(executor, 190)
    place = tuple(run.problem.robot.fk(second.trajectory(t)).matrix[:3, 3])
    executor.update_scene({"ball": op.Pose(place)})
    after(executor, 10)
    executor.state_in(0.05)
    return executor, CollisionModel(run.problem.robot, op.Scene([op.Sphere("ball", radius=0.05, position=place)]))


def test_a_run_that_takes_over_knows_what_was_seen_elsewhere(beside):
    executor, model = seen_at(beside, beside[1].duration)
    assert executor.status.reason == ""
    assert executor.splice(beside[1])
    ticks = settled(executor)
    assert executor.run is beside[1]
    assert "'ball'" in executor.status.reason
    assert not any(model.collides(tick.q) for tick in ticks)


def test_a_run_that_takes_over_keeps_the_clearance_from_what_it_was_planned_beside(beside):
    run, second = beside
    X = run.problem.robot.fk(second.trajectory.end).matrix
    place = tuple(X[:3, 3] + 0.08 * X[:3, 2])
    scene, far = op.Scene([op.Sphere("ball", radius=0.05, position=place)]), 0.05
    third = op.plan(derived(second.problem, scene=scene), budget=2.0)
    assert third.verified
    executor = op.Executor(run, clearance=far)
    after(executor, 200)
    executor.update_scene({"ball": op.Pose(place)})
    executor.state_in(0.05)
    assert executor.splice(third)
    ticks = settled(executor)
    model = CollisionModel(run.problem.robot, scene)

    def near(q):
        return any("ball" in (one.pair.name_a, one.pair.name_b) for one in model.contacts(q, far))

    assert executor.run is third
    assert executor.status.phase == "waiting"
    assert near(third.trajectory.end)
    assert not any(near(tick.q) for tick in ticks)


def test_a_run_is_refused_whose_first_stop_is_blocked_by_what_was_seen(beside):
    run, second = beside
    executor, model = seen_at(beside, 0.25)
    assert executor.status.reason == ""  # along its own path it can go on
    assert not executor.splice(second)
    assert "obstacles block" in executor.status.reason
    assert not any(model.collides(tick.q) for tick in settled(executor))
    later = op.Executor(run)
    after(later, 200)
    later.state_in(0.05)
    assert later.splice(second)
    place = run.problem.robot.fk(second.trajectory(0.25)).matrix[:3, 3]
    later.update_scene({"ball": op.Pose(tuple(place))})  # before it takes over
    assert "obstacles block" in later.status.reason
    assert not any(model.collides(tick.q) for tick in settled(later))


@pytest.fixture(scope="module")
def aside(run_of):
    """A run, and one to elsewhere that leaves it at 0.4 s and could brake at once there."""
    run = run_of("01_reach")
    executor = op.Executor(run)
    after(executor, 100)
    goal = run.trajectory.end + np.array([-0.6, 0.2, 0.0, 0.3, 0.0, 0.3, 0.0])
    problem = run.problem.with_start(executor.state_in(0.3)).with_goal(goal)
    return run, op.plan(problem, planner="septic", budget=2.0)


def beside_ball(aside, way, place, radius, when=0.1):
    """An executor with the run that is to leave the other one at 0.4 s, and a ball on the way of a run, just seen."""
    executor = op.Executor(aside[0])
    after(executor, 100)
    begin = executor.state_in(0.3)
    assert executor.splice(aside[1])
    while executor.time < when - 1e-9:
        executor.tick(DT)
    ball = op.Sphere("ball", radius, position=tuple(way.problem.robot.fk(way.trajectory(place)).position))
    executor.update_scene({"ball": ball})
    return executor, begin, CollisionModel(way.problem.robot, op.Scene([ball]))


def test_a_run_that_is_blocked_brakes_where_it_takes_over_and_not_before(aside):
    _, second = aside
    executor, begin, model = beside_ball(aside, second, 0.8 * second.duration, 0.05)
    assert executor.status.reason == ""
    after(executor, 260)
    tick = executor.tick(0.04)  # to the very time
    assert executor.run is second
    assert "'ball'" in executor.status.reason
    np.testing.assert_allclose(tick.v, begin.v, atol=1e-6)
    np.testing.assert_allclose(tick.a, begin.a, atol=1e-3)
    assert not any(model.collides(one.q) for one in settled(executor))


def test_a_run_takes_over_though_the_way_that_it_leaves_is_blocked_later(aside):
    run, second = aside
    executor, _, model = beside_ball(aside, run, run.duration, 0.05)
    executor.override = 1.0  # as it is
    assert executor.status.reason == ""
    ticks = settled(executor)
    assert (executor.run is second, executor.status.phase, executor.status.reason) == (True, "done", "")
    assert_continuous(second, ticks)
    paused, _, _ = beside_ball(aside, run, run.duration, 0.05)
    after(paused, 299)
    paused.pause()
    ticks += settled(paused)
    assert paused.run is run
    assert "too late" not in paused.status.reason
    assert not any(model.collides(tick.q) for tick in ticks)


def test_a_run_takes_over_where_it_alone_leads_past_what_is_too_near_to_stop(aside):
    run, second = aside
    executor, _, model = beside_ball(aside, run, 0.62, 0.05, when=0.395)
    assert executor.status.reason == ""
    assert not any(model.collides(tick.q) for tick in settled(executor))
    assert executor.run is second


def test_a_run_whose_begin_is_not_reached_is_dropped_and_that_is_said(aside):
    run, _ = aside
    executor, _, model = beside_ball(aside, run, 0.3, 0.04)
    assert "would meet 'ball'" in executor.status.reason
    assert executor.status.reason.endswith("; the motion that was to take over is dropped")
    assert not any(model.collides(tick.q) for tick in settled(executor))
    assert (executor.run is run, executor.status.phase) == (True, "waiting")
    late = beside_ball(aside, run, 0.22, 0.05)[0].status.reason
    assert late.endswith("; the motion that was to take over is dropped; the stop comes too late")


def test_a_run_is_refused_that_forgets_what_the_robot_holds(run_of):
    run = run_of("40_panda_sorts_cubes")
    executor = op.Executor(run)
    attach = next(event for event in run.trajectory.segments if event.kind == "attach")
    while executor.status.place < attach.end + 0.5:
        executor.tick(5e-3)
    executor.pause()
    settled(executor)
    q = executor.state_in(0.0).q
    still, goal = np.zeros(len(q)), op.JointGoal(q + np.eye(len(q))[0] * 0.2)
    own = {
        "start": q,
        "start_velocity": still,
        "start_acceleration": still,
        "task": (),
        "goal": (goal,),
        "scene": op.Scene(),
    }
    second = op.plan(derived(run.problem, **own), budget=3.0)
    assert second.verified
    assert not executor.splice(second)
    assert "with nothing in hand" in executor.status.reason


def test_a_velocity_without_a_pose_ends_in_a_stop(run_of):
    """A name with a slip of the pen left the body standing."""
    executor = op.Executor(run_of("01_reach"))
    ball = op.Sphere("ball", 0.05, position=(2.0, 0.0, 0.5))
    executor.update_scene({"ball": ball}, {"bal": (1.0, 0.0, 0.0)})
    assert executor.status.reason == "update_scene: found a velocity of the str 'bal' without a pose; expected both"


def test_questions_with_wrong_numbers_are_refused(run_of):
    executor = op.Executor(run_of("01_reach"))
    for value in (-1, 0, 2.5, "x", None, True):
        with pytest.raises(op.InputError, match="places: found"):
            executor.stopping(value)
    for value in (-1.0, np.nan, np.inf, "x", None):
        with pytest.raises(op.InputError, match="lead: found"):
            executor.ahead(value)


@pytest.mark.parametrize("left", [0.002, 0.01, 0.03])
def test_a_robot_that_is_asked_to_turn_just_before_an_end_turns_there(run_of, left):
    """Where no stop fits in before the end, the law leads to it at speed: the robot stood there for ever."""
    run = run_of("01_reach")
    executor = op.Executor(run)
    ticks = [executor.tick(DT)]
    while ticks[-1].status.place < run.duration - left:
        ticks.append(executor.tick(DT))
    executor.reverse()
    ticks += [executor.tick(DT) for _ in range(200)]
    assert "done" not in {tick.status.phase for tick in ticks}  # also not at the very end, where it turns
    assert executor.status.place < run.duration - 2.0 * left
    while ticks[-1].status.place > left:
        ticks.append(executor.tick(DT))
    executor.resume()
    ticks += [executor.tick(DT) for _ in range(2500)]
    assert executor.status.phase == "done"
    assert_continuous(run, ticks)
