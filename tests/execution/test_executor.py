"""The executor: set-points on the proved path within all limits, whatever is asked of it and whenever."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

import optiplan as op
from optiplan.problem.problem import derived
from optiplan.problem.task.timeline import part_of_last_event, scene_parts

DT = 1e-3


def executed(executor, asks, most=20_000):
    """Run to the end, asking at random; return the ticks."""
    ticks = []
    while executor.status.phase != "done" and len(ticks) < most:
        asks(executor, len(ticks))
        ticks.append(executor.tick(DT))
    return ticks


def assert_within_limits(run, ticks):
    limits, motion = run.problem.limits, run.trajectory
    q, v, a, torque = (np.array([getattr(tick, key) for tick in ticks]) for key in ("q", "v", "a", "torque"))
    places = np.array([tick.status.place for tick in ticks])
    np.testing.assert_allclose(q, motion(np.clip(places, 0.0, motion.duration)), atol=1e-9)
    assert (np.abs(v) <= limits.velocity * (1 + 2e-6)).all()
    assert (np.abs(a) <= limits.acceleration * (1 + 2e-6)).all()
    assert (np.abs(np.diff(a, axis=0)) <= limits.jerk * DT * (1 + 2e-6) + 1e-9).all()
    assert (np.abs(torque) <= limits.torque * (1 + 2e-6)).all()
    np.testing.assert_allclose(np.diff(q, axis=0), 0.5 * DT * (v[1:] + v[:-1]), atol=2e-6)


def random_asks(seed, rate=0.01, until=2500):
    """The events of `benchmarks/execution_events.py`, but for stops off the path and what needs obstacles or plans."""
    events, rng = pytest.importorskip("benchmarks.execution_events"), np.random.default_rng(seed)
    kinds = [kind for kind in events.EVENTS if kind not in ("joints", "obstacle", "splice")]

    def asks(executor, k):
        if k == until:
            executor.override = 1.0
            executor.resume()
        if k < until and rng.random() < rate:
            events.happen(executor, kinds[rng.integers(len(kinds))], rng)

    return asks


def test_coasting_at_rest_takes_no_time(run_of):
    """A machine may have slept for days; the robot stood at the end of its motion."""
    executor = op.Executor(run_of("01_reach"))
    executor.coast(1e6)
    tick = executor.tick(DT)
    assert (tick.status.phase, executor.time) == ("done", 1e6 + DT)
    np.testing.assert_allclose(tick.q, executor.run.trajectory.end, atol=1e-12)


@pytest.mark.parametrize("name", ["01_reach", "02_shelf", "11_baxter", "15_srra", "16_delbot", "22_via_spline"])
def test_random_changes_keep_every_limit(run_of, name):
    run = run_of(name)
    for seed in range(2):
        executor = op.Executor(run)
        ticks = executed(executor, random_asks(seed))
        assert executor.status.phase == "done"
        assert_within_limits(run, ticks)
        np.testing.assert_allclose(ticks[-1].q, run.trajectory.end, atol=1e-12)


def test_a_task_hands_out_each_event_once(run_of):
    run = run_of("40_panda_sorts_cubes")
    ticks = executed(op.Executor(run), random_asks(4, rate=0.002, until=15_000), most=60_000)
    done = [event for tick in ticks for event in tick.events]
    assert done == [one for one in run.trajectory.segments if one.kind in ("attach", "detach", "gripper")]
    assert_within_limits(run, ticks)


def test_untouched_it_is_the_planned_motion(run_of):
    run = run_of("01_reach")
    executor = op.Executor(run)
    for k in range(1, 500):
        tick = executor.tick(DT)
        np.testing.assert_allclose(tick.q, run.trajectory(k * DT), atol=1e-12)
    assert tick.status.phase == "running"
    assert tick.status.speed == 1.0


def test_pause_and_resume(run_of):
    executor = op.Executor(run_of("01_reach"))
    for _ in range(100):
        executor.tick(DT)
    executor.pause()
    assert executor.status.phase == "changing"
    while executor.status.phase != "paused":
        tick = executor.tick(DT)
    still = tick.q
    for _ in range(100):
        np.testing.assert_array_equal(executor.tick(DT).q, still)
    executor.resume()
    while executor.status.phase != "running":
        executor.tick(DT)
    assert executor.status.speed == 1.0


def test_reverse_goes_back_to_the_start(run_of):
    run = run_of("01_reach")
    executor = op.Executor(run)
    for _ in range(300):
        executor.tick(DT)
    executor.reverse()
    for _ in range(3000):
        tick = executor.tick(DT)
    np.testing.assert_allclose(tick.q, run.trajectory.start, atol=1e-9)
    assert tick.status.place == pytest.approx(0.0, abs=1e-12)
    assert tick.status.speed == 0.0
    executor.resume()
    ticks = executed(executor, lambda *_: None)
    np.testing.assert_allclose(ticks[-1].q, run.trajectory.end, atol=1e-12)


def test_a_slow_start(run_of):
    executor = op.Executor(run_of("01_reach"), override=0.2)
    assert executor.tick(DT).status.speed == 0.2
    paused = op.Executor(run_of("01_reach"), override=0.0)
    assert paused.tick(DT).status.phase == "paused"
    paused.override = 0.5
    paused.resume()
    for _ in range(300):
        tick = paused.tick(DT)
    assert tick.status.speed == 0.5


def test_a_splice_is_continuous(run_of):
    run = run_of("01_reach")
    executor = op.Executor(run)
    for _ in range(200):
        executor.tick(DT)
    state = executor.state_in(0.05)
    second = op.plan(run.problem.with_start(state), budget=2.0)
    assert second.verified
    assert executor.splice(second)
    ticks = executed(executor, lambda *_: None)
    assert executor.run is second
    a = np.array([tick.a for tick in ticks])
    v = np.array([tick.v for tick in ticks])
    q = np.array([tick.q for tick in ticks])
    assert (np.abs(np.diff(a, axis=0)) <= run.problem.limits.jerk * DT * (1 + 1e-5) + 1e-6).all()
    np.testing.assert_allclose(np.diff(q, axis=0), 0.5 * DT * (v[1:] + v[:-1]), atol=2e-6)


@pytest.mark.parametrize("how", ["path", "joints"])
def test_another_motion_can_begin_wherever_a_robot_brakes(run_of, how):
    """It braked by a millionth harder than a start may be stated."""
    run = run_of("01_reach")
    for place in np.linspace(0.1, 0.7, 7):
        executor = op.Executor(run)
        while executor.time < place:
            executor.tick(0.01)
        executor.stop("test", how)
        for latency in np.linspace(0.0, 0.1, 6):
            run.problem.with_start(executor.state_in(latency))


def test_an_execution_is_not_done_before_the_run_that_is_to_take_over(run_of):
    run = run_of("01_reach")
    executor = op.Executor(run)
    while executor.status.place < run.duration - 0.02:
        executor.tick(DT)
    state = executor.state_in(0.3)
    assert not state.v.any()
    home = op.plan(run.problem.with_start(state).with_goal(run.problem.start), budget=1.0)
    assert executor.splice(home)
    phases = [tick.status.phase for tick in executed(executor, lambda *_: None)]
    assert phases.index("done") == len(phases) - 1
    assert executor.run is home


@pytest.fixture(scope="module")
def home(run_of):
    """A run from the end of `01_reach` to its start."""
    run = run_of("01_reach")
    return op.plan(run.problem.with_start(run.trajectory.end).with_goal(run.problem.start), budget=1.0)


@pytest.mark.parametrize("ask", [lambda executor: None, lambda executor: setattr(executor, "override", 0.5)])
def test_at_the_end_another_run_takes_over_whenever_it_comes(run_of, home, ask):
    executor = op.Executor(run_of("01_reach"))
    executed(executor, lambda *_: None)
    executor.state_in(0.0)
    ask(executor)
    for _ in range(50):
        executor.tick(DT)
    assert executor.splice(home)
    ticks = executed(executor, lambda *_: None)
    assert executor.status.reason == ""
    np.testing.assert_allclose(ticks[-1].q, home.trajectory.end, atol=1e-12)


def test_a_run_from_a_state_that_was_passed_is_late_also_at_the_end(run_of):
    run = run_of("01_reach")
    executor = op.Executor(run)
    for _ in range(200):
        executor.tick(DT)
    second = op.plan(run.problem.with_start(executor.state_in(0.05)), budget=1.0)
    executed(executor, lambda *_: None)
    assert not executor.splice(second)
    assert "late" in executor.status.reason


def test_a_run_of_a_robot_that_is_mounted_elsewhere_or_another_one_is_refused(run_of, home):
    robot = home.problem.robot
    moved = robot.mounted(replace(robot.mounting, X_WB=pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.1]))))
    for other in (moved, replace(robot, fingerprint="of another file"), replace(robot, locked={"finger": 0.04})):
        executor = op.Executor(run_of("01_reach"))
        executed(executor, lambda *_: None)
        assert not executor.splice(replace(home, problem=derived(home.problem, robot=other)))
        assert "of another robot" in executor.status.reason


def test_a_robot_that_stands_at_an_end_begins_as_fast_as_planned(run_of):
    """As the motion does, which is at rest there: there is nothing to be led up to."""
    run = run_of("01_reach")
    executor = op.Executor(run, override=0.0)
    executor.tick(DT)
    executor.override = 1.0
    executor.resume()
    begin = executor.time
    executed(executor, lambda *_: None)
    assert executor.time - begin == pytest.approx(run.duration, abs=2 * DT)
    executor.reverse()
    ticks, begin = [executor.tick(DT)], executor.time
    while executor.status.place > 0.0:
        ticks.append(executor.tick(DT))
    assert executor.time - begin == pytest.approx(run.duration, abs=2 * DT)
    assert_within_limits(run, ticks)


CUBE = op.Box("cube", size=(0.04, 0.04, 0.04), position=(0.0, 0.0, 1.5))
UR5 = [0.0, -1.5, 1.5, -1.5, -1.5, 0.0]


def carried(start, goal, cube):
    task = op.Task().attach("cube", "wrist_3_link", mass=1.0).move(goal).detach("cube")
    run = op.plan(op.Problem("ur5", start, scene=op.Scene([cube]), task=task), budget=3.0)
    assert run.verified
    return run


def test_what_is_in_hand_at_the_ends_of_a_task_is_what_its_events_there_left():
    first = carried(UR5, [0.2, -1.4, 1.4, -1.5, -1.5, 0.0], CUBE)
    executor = op.Executor(first)
    ticks = executed(executor, lambda *_: None)
    assert [event.kind for tick in ticks for event in tick.events] == ["attach", "detach"]
    q, still = ticks[-1].q, np.zeros(6)
    model = first.problem.robot.model
    np.testing.assert_allclose(ticks[-1].torque, pin.rnea(model, model.createData(), q, still, still), atol=1e-6)
    assert np.abs(ticks[-1].torque - ticks[-2].torque).max() > 1.0
    last = scene_parts(first.problem, first.trajectory)[-1].problem
    holding = derived(last, start=q, goal=(op.JointGoal(np.array(UR5)),))
    assert not executor.splice(op.plan(holding, budget=1.0))
    assert "begins with cube in hand; the robot will hold nothing" in executor.status.reason
    executor.resume()
    placed = part_of_last_event(first.problem, first.trajectory).problem.scene.obstacles[0]
    again = carried(q, UR5, placed)
    assert executor.splice(again)
    done = executed(executor, lambda *_: None)
    assert executor.run is again
    assert [event.kind for tick in done for event in tick.events] == ["attach", "detach"]


def test_a_splice_that_is_late_or_elsewhere_ends_in_a_stop(run_of):
    run = run_of("01_reach")
    executor = op.Executor(run)
    state = executor.state_in(0.02)
    second = op.plan(run.problem.with_start(state), budget=1.0)
    for _ in range(100):
        executor.tick(DT)
    assert not executor.splice(second)
    assert "late" in executor.status.reason
    while executor.status.phase == "stopping":
        executor.tick(DT)
    assert executor.status.phase in ("stopped", "done")
    other = op.Executor(run)
    assert not other.splice(run_of("02_shelf"))
    assert "not on the way" in other.status.reason


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        (lambda ex: ex.tick(float("nan")), "tick"),
        (lambda ex: ex.tick(-0.1), "tick"),
        (lambda ex: ex.tick(1.0), "at most 0.1 s"),
        (lambda ex: ex.tick("soon"), "tick"),
        (lambda ex: ex.tick(DT, [0.0]), "measured"),
        (lambda ex: ex.tick(DT, np.full(7, np.nan)), "measured"),
        (lambda ex: ex.tick(DT, np.full(7, 9.0)), "off the path"),
        (lambda ex: setattr(ex, "override", 1.5), "override"),
        (lambda ex: setattr(ex, "override", float("nan")), "override"),
    ],
)
def test_faults_end_in_a_stop_with_a_reason(run_of, fault, words):
    executor = op.Executor(run_of("01_reach"), deviation=0.05)
    for _ in range(150):
        executor.tick(DT)
    fault(executor)
    assert words in executor.status.reason
    while executor.status.phase == "stopping":
        executor.tick(DT)
    assert executor.status.phase in ("stopped", "done")
    assert executor.status.speed == 0.0


def test_the_stop_of_every_place(run_of):
    run = run_of("01_reach")
    stops = op.Executor(run).stopping(40)
    assert len(stops.time) == 40
    assert (stops.place + stops.travel <= run.duration + 1e-9).all()
    assert (stops.travel <= stops.time + 1e-9).all()  # never faster than planned
    assert stops.time.max() < run.duration


def test_what_cannot_be_executed_is_refused(run_of):
    run = run_of("01_reach")
    with pytest.raises(op.InputError, match="Executor: run: found the object"):
        op.Executor(object())
    with pytest.raises(op.InputError, match="a run that is not verified"):
        op.Executor(replace(run, report=None))
    with pytest.raises(op.InputError, match="override"):
        op.Executor(run, override=2.0)
    with pytest.raises(op.InputError, match="deviation"):
        op.Executor(run, deviation=-1.0)
    with pytest.raises(op.InputError, match="latency"):
        op.Executor(run).state_in(-1.0)
    with pytest.raises(op.InputError, match="move by the clock"):
        op.Executor(run_of("38_falling_ball"))


@pytest.mark.parametrize("end", [0, -1])
def test_a_motion_rests_at_its_ends_where_the_verifier_says_so(run_of, end):
    run = run_of("01_reach")
    coefficients = np.array(run.trajectory.coefficients)
    coefficients[end, 1] += 5e-6 * run.problem.limits.velocity  # to the position, too: a piece is 0.1 s
    motion = op.Trajectory(run.trajectory.joint_names, run.trajectory.breakpoints, coefficients)
    slow = replace(run, trajectory=motion, report=op.verify(run.problem, motion))
    assert slow.verified, slow.report
    executor = op.Executor(slow)
    while executor.status.phase != "done":
        executor.tick(1e-3)


def test_a_short_run_of_all_events(run_of):
    """Sixty events of `benchmarks/execution_events.py`, where 100,000 are."""
    events = pytest.importorskip("benchmarks.execution_events")
    run, joins = events.prepared("01_reach", 2.0)
    found = events.execute(run, joins[:2], 60)
    assert found.violations == []
    assert found.events == 60
    assert found.off <= 1e-9
    assert found.detours > 0
