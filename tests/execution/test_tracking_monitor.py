"""Measured states: what they are compared with, and what ends in a stop, row by row of docs/how-to/execute.md."""

import time

import numpy as np
import pytest

import optiplan as op
from optiplan.errors import InputError

DT = 1e-3


@pytest.fixture(scope="module")
def run():
    found = op.plan(op.load_problem("01_reach"), tracking_error=0.004)
    assert found.verified
    return found


@pytest.fixture(scope="module")
def plain():
    return op.plan(op.load_problem("01_reach"))


def executed(executor, measure, ticks=300):
    """Tick with what `measure(k, set-points so far)` returns; the first set-point is the start."""
    way = [executor.run.trajectory.start]
    for k in range(ticks):
        way.append(executor.tick(DT, measure(k, way)).q)
    return way


def stopped(executor):
    """Whether it comes to its stop on the path."""
    while executor.status.phase == "stopping":
        executor.tick(DT)
    return executor.status.phase in ("stopped", "done") and executor.status.speed == 0.0


def test_a_lag_lies_on_the_path(run):
    executor = op.Executor(run)
    executed(executor, lambda k, way: way[max(0, len(way) - 1 - 30)])
    status = executor.status
    assert status.reason == ""
    assert status.lag == pytest.approx(0.030, abs=1e-3)
    assert status.deviation < 1e-4


def test_the_age_of_a_state_is_no_lag(run):
    executor = op.Executor(run)
    executed(executor, lambda k, way: op.Measurement(way[max(0, k - 8)], np.zeros(7), k * DT, 0.008))
    assert executor.status.lag == pytest.approx(0.0, abs=1e-3)
    executor = op.Executor(run, tracking=op.TrackingPolicy(latency=0.008))
    executed(executor, lambda k, way: op.State(way[max(0, k - 8)]))
    assert executor.status.lag == pytest.approx(0.0, abs=1e-3)


def test_within_the_tube_it_goes_on_to_the_end(run):
    rng = np.random.default_rng(0)
    executor = op.Executor(run)
    executed(executor, lambda k, way: way[max(0, k - 12)] + rng.uniform(-0.0038, 0.0038, 7), 1000)
    assert executor.status.phase == "done"
    assert executor.status.reason == ""
    assert 0.0035 < executor.status.deviation < 0.004


@pytest.mark.parametrize("joint", [0, 3, 6])
def test_beyond_the_tube_it_stops(run, joint):
    executor = op.Executor(run)
    executed(executor, lambda k, way: way[-1] + 0.02 * (k > 100) * np.eye(7)[joint], 200)
    assert "off the path, farther than 0.004" in executor.status.reason
    assert stopped(executor)


def test_a_deviation_is_a_bound_of_its_own(run, plain):
    for made, bound in ((op.Executor(run, deviation=0.002), 0.002), (op.Executor(plain, deviation=0.01), 0.01)):
        executed(made, lambda k, way, bound=bound: way[-1] + 1.2 * bound * (k > 50), 100)
        assert f"farther than {bound:g}" in made.status.reason
    free = op.Executor(plain)
    executed(free, lambda k, way: way[-1] + 0.003, 100)
    assert free.status.reason == ""
    assert free.status.deviation == pytest.approx(0.003, rel=0.5)


def test_backwards_and_after_a_splice_the_path_is_the_one_that_was_passed(run):
    executor = op.Executor(run)
    executed(executor, lambda k, way: way[max(0, k - 5)], 300)
    executor.reverse()
    way = []
    for _ in range(900):
        way.append(executor.tick(DT, way[-6] if len(way) > 5 else None).q)
    assert executor.status.reason == ""
    assert executor.status.deviation < 1e-4
    executor.resume()
    for _ in range(120):
        way.append(executor.tick(DT, way[-6]).q)
    state = executor.state_in(0.05)
    onwards = op.plan(run.problem.with_start(state), budget=1.0)
    assert onwards.verified
    assert executor.splice(onwards)
    for _ in range(1000):
        way.append(executor.tick(DT, way[-6]).q)
    assert executor.status.phase == "done"
    assert executor.status.reason == ""
    assert executor.status.deviation < 1e-4
    assert executor.run is onwards


def test_a_robot_a_little_ahead_of_its_set_point_is_not_behind_on_a_way_that_it_comes_back(plain):
    """It was found where it had come, nearer by a hair: at each retreat along an approach it was said to be late."""
    executor, ticks = op.Executor(plain), []
    for k in range(900):
        if k == 400:
            executor.reverse()
        point = executor._point()
        ticks.append(executor.tick(1e-3, point.q + 2e-3 * point.v))
    assert ticks[-1].status.speed < -0.5
    assert max(abs(tick.status.lag) for tick in ticks) < 0.02


def faulty(fault):
    """States that are good for 100 ticks, and then what `fault(k, state)` makes of them."""

    def measure(k, way):
        good = op.Measurement(way[-1], np.zeros(7), k * DT, 0.002)
        return good if k < 100 else fault(k, good)

    return measure


def changed(good, **values):
    return op.Measurement(**{**vars(good), **values})


ROWS = {
    "wrong size": (lambda k, m: changed(m, q=m.q[:3]), "expected 7 finite positions"),
    "not a number": (
        lambda k, m: changed(m, q=np.where(np.arange(7) == 2, np.nan, m.q)),
        "expected 7 finite positions",
    ),
    "no state at all": (lambda k, m: "here", "expected 7 finite positions"),
    "lags": (lambda k, m: changed(m, q=np.array(START)), "behind on the path, more than 0.25 s"),
    "stamp not finite": (lambda k, m: changed(m, stamp=float("inf")), "expected seconds, an age >= 0"),
    "age below 0": (lambda k, m: changed(m, age=-0.1), "expected seconds, an age >= 0"),
    "age is no number": (lambda k, m: changed(m, age="old"), "expected seconds, an age >= 0"),
    "stamps run backwards": (lambda k, m: changed(m, stamp=0.05), "ran backwards by 0.049 s"),
    "frozen": (lambda k, m: changed(m, stamp=0.099), "has been the same for 0.10"),
    "old": (lambda k, m: changed(m, age=0.15), "the state is 0.150 s old, more than 0.1 s"),
    "leaps": (lambda k, m: changed(m, stamp=m.stamp + 5.0), "leapt by 5.001 s in 0.001 s"),
    "jumps": (lambda k, m: changed(m, q=m.q + 0.012 * (k % 2)), "jumped by 0.01"),
    "silent": (lambda k, m: None, "there has been no state for 0.10"),
}
START: list[float] = []


@pytest.mark.parametrize("row", ROWS)
def test_each_fault_ends_in_the_proved_stop_with_its_reason(plain, row):
    fault, words = ROWS[row]
    START[:] = plain.trajectory(0.1).tolist()
    executor = op.Executor(plain)
    executed(executor, faulty(fault), 500 if row == "lags" else 250)
    assert words in executor.status.reason
    assert stopped(executor)


def test_after_a_restart_of_the_clock_resume_goes_on(plain):
    executor = op.Executor(plain)
    executed(executor, faulty(lambda k, m: changed(m, stamp=m.stamp - 5.0)), 200)
    assert "backwards" in executor.status.reason
    while executor.status.phase == "stopping":
        executor.tick(DT)
    executor.resume()
    assert executor.status.reason == ""


def test_silence_before_the_first_state_and_at_the_end_is_no_fault(plain):
    executor = op.Executor(plain)
    executed(executor, lambda k, way: None, 150)
    executed(executor, lambda k, way: executor.tick(0.0).q if k < 700 else None, 1200)
    assert executor.status.phase == "done"
    assert executor.status.reason == ""


def test_a_joint_without_end_may_be_counted_by_turns(endless_run):
    executor = op.Executor(endless_run, deviation=0.01)
    executed(executor, lambda k, way: way[-1] - 2.0 * np.pi, 50)
    assert executor.status.reason == ""
    executed(executor, lambda k, way: way[-1] - 2.0, 1)
    assert "off the path" in executor.status.reason


@pytest.mark.parametrize("step", [100, 40])
def test_between_two_ticks_the_robot_is_expected_on_the_path(run, step):
    """Not on the straight line between two set-points, 25 mrad beside it at 10 Hz; also where it turns in between."""
    fine, way = op.Executor(run), [run.trajectory.start]
    coarse = op.Executor(run, tracking=op.TrackingPolicy(latency=0.5 * step * DT))
    for k in range(1200 // step):
        if k * step == 400:
            fine.reverse(), coarse.reverse()
        tick = coarse.tick(step * DT, way[max(0, k * step - step // 2)])
        way += [fine.tick(DT).q for _ in range(step)]
        np.testing.assert_allclose(way[-1], tick.q, atol=1e-9)
    assert coarse.status.speed < 0.0
    assert coarse.status.reason == ""
    assert coarse.status.deviation < 1e-4


@pytest.mark.parametrize(
    "given", [{"most_lag": -1.0}, {"latency": "soon"}, {"oldest": float("nan")}, {"least_clearance": -0.1}]
)
def test_a_policy_that_cannot_be(given):
    with pytest.raises(InputError, match=r"op\.TrackingPolicy: " + next(iter(given))):
        op.TrackingPolicy(**given)


def test_a_policy_is_one(plain):
    with pytest.raises(InputError, match=r"op\.Executor: tracking"):
        op.Executor(plain, tracking=0.1)


def test_a_tick_with_a_state_is_fast(run):
    executor = op.Executor(run)
    spent, way = [], [run.trajectory.start]
    for k in range(700):
        state = op.Measurement(way[max(0, k - 5)], np.zeros(7), k * DT, 0.004)
        began = time.thread_time()
        way.append(executor.tick(DT, state).q)
        spent.append(time.thread_time() - began)
    assert np.median(spent) < 5e-4  # some 25 µs, 100 on a slow and busy machine; the table is made on a quiet one


def test_a_jump_is_seen_of_a_driver_that_writes_its_states_into_one_array(plain):
    """The array of the state before is that of the new one: it was compared with itself."""
    executor, q = op.Executor(plain, deviation=0.5), np.array(plain.trajectory.start)
    for k in range(20):
        q[:] = executor.tick(DT, op.Measurement(q, 0.0 * q, DT * k)).q
    q[2] += 0.1
    assert (
        "the state of panda_joint3 jumped by 0.1" in executor.tick(DT, op.Measurement(q, 0.0 * q, 0.02)).status.reason
    )
