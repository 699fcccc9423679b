"""Synchronised, independent and sequential motion: ends, limits and durations, for any distances."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from optiplan.trajectory.profiles.laws import CUBIC, QUINTIC, BangBang, SCurve, Trapezoid
from optiplan.trajectory.profiles.synchronisation import RestToRest
from optiplan.trajectory.timing.lower_bound import lower_bound
from optiplan.trajectory.tolerances import SHORTEST_DURATION
from tests.trajectory.test_timing import limits_of

LAWS = [CUBIC, QUINTIC, Trapezoid(), BangBang(), SCurve()]
HOW = ["synchronised", "independent", "sequential"]
DISTANCE = st.one_of(st.just(0.0), st.floats(-6.0, 6.0), st.sampled_from([1e-15, -1e-12, 1e-9, -1e-7, 5e-324]))
LIMIT = st.floats(-6.0, 6.0).map(lambda x: 10.0**x)
TRIPLE = st.tuples(LIMIT, LIMIT, LIMIT)


def motion_of(distances, limits, law, how="synchronised"):
    start = 0.25 * np.arange(len(distances))
    names = tuple("abcdefg"[: len(distances)])
    return RestToRest(start, start + np.array(distances), limits, names, lambda _: law, how)


@settings(max_examples=80, deadline=None)
@given(
    st.lists(st.tuples(DISTANCE, TRIPLE), min_size=1, max_size=4),
    st.sampled_from(LAWS),
    st.sampled_from(HOW),
    st.one_of(st.none(), st.floats(1.0, 30.0)),
)
def test_ends_and_limits(joints, law, how, longer):
    limits = limits_of(*np.array([sizes for _, sizes in joints]).T)
    motion = motion_of([distance for distance, _ in joints], limits, law, how)
    duration = None if longer is None else longer * motion.shortest
    made = motion.trajectory(duration)
    assert made.duration == pytest.approx(duration or motion.shortest, rel=1e-9)
    assert np.abs(made.start - motion.start).max() == 0.0
    assert np.abs(made.end - motion.goal).max() < 1e-12
    ends = np.array([0.0, made.duration])
    assert (np.abs(made(ends, 1)) <= 1e-6 * limits.velocity).all()
    assert (np.abs(made.jumps(1)).sum(axis=0, initial=0.0) <= 1e-6 * limits.velocity).all()
    smooth = isinstance(law, SCurve) or law is QUINTIC
    if smooth:
        steps = np.abs(np.vstack([made(ends, 2), made.jumps(2)])).sum(axis=0)
        assert (steps <= 1e-6 * limits.acceleration).all()
    for order, name in ((1, "velocity"), (2, "acceleration"), (3, "jerk"))[: 2 if law in LAWS[2:4] else 3]:
        assert (np.abs(made.extrema(order)).max(axis=0) <= getattr(limits, name) * (1.0 + 1e-6)).all(), name


THREE = limits_of([1.0, 2.0, 0.5], [4.0, 1.0, 3.0], [30.0, 9.0, 40.0])


@pytest.mark.parametrize("law", LAWS)
def test_synchronised_is_a_straight_line(law):
    motion = motion_of([1.0, -0.4, 0.0], THREE, law)
    made = motion.trajectory()
    s = (made(np.linspace(0.0, made.duration, 200)) - motion.start) / np.array([1.0, -0.4, 1.0])
    assert np.abs(s[:, 0] - s[:, 1]).max() < 1e-12
    assert np.abs(s[:, 2]).max() == 0.0


@pytest.mark.parametrize("law", LAWS)
def test_independent_joints_each_stop_when_they_can(law):
    distances = [1.0, -0.4, 0.3]
    made = motion_of(distances, THREE, law, "independent").trajectory()
    for j, distance in enumerate(distances):
        alone = motion_of(
            [distance], limits_of(*([x[j]] for x in (THREE.velocity, THREE.acceleration, THREE.jerk))), law
        )
        t = np.linspace(0.0, alone.shortest, 100)
        expected = alone.trajectory()(t)[:, 0]
        assert made(t)[:, j] - 0.25 * j == pytest.approx(expected, abs=1e-10)
        later = made(np.linspace(alone.shortest, made.duration, 20))[:, j]
        assert later == pytest.approx(0.25 * j + distance, abs=1e-10)


@pytest.mark.parametrize("duration", [None, 20.0])
def test_sequential_moves_one_joint_after_another(duration):
    motion = motion_of([1.0, 0.0, -0.3], THREE, QUINTIC, "sequential")
    made = motion.trajectory(duration)
    moving = np.abs(made(np.linspace(0.0, made.duration, 400), 1)) > 1e-9
    assert moving.sum(axis=1).max() == 1
    assert np.flatnonzero(moving[:, 0]).max() < np.flatnonzero(moving[:, 2]).min()
    times = np.array([part.duration for part in motion.parts()])
    assert motion.shortest == pytest.approx(times.sum())
    shares = np.array([part.duration for part in motion.parts(duration)]) / made.duration
    assert shares == pytest.approx(times / times.sum())


def test_sequential_parts_may_share_by_distance():
    base = motion_of([1.0, 0.0, -0.25], THREE, QUINTIC, "sequential")
    motion = RestToRest(base.start, base.goal, THREE, base.joint_names, base.law, "sequential", share_by_distance=True)
    assert [part.duration for part in motion.parts(5.0)] == pytest.approx([4.0, 1.0])
    each = [part.duration for part in base.parts()]
    assert motion.shortest == pytest.approx(max(each[0] / 0.8, each[1] / 0.2))


def test_an_s_curve_takes_the_lower_bound_of_the_slowest_joint():
    distances = np.array([1.0, -0.4, 0.3])
    for how in ("synchronised", "independent"):
        motion = motion_of([1.0, 0.0, 0.0] if how == "synchronised" else distances, THREE, SCurve(), how)
        assert motion.shortest == pytest.approx(lower_bound(motion.start, motion.goal, THREE), rel=1e-12)


@pytest.mark.parametrize("how", HOW)
def test_going_nowhere_takes_a_moment(how):
    motion = motion_of([0.0, 0.0, 0.0], THREE, SCurve(), how)
    assert motion.trajectory().duration == SHORTEST_DURATION
    assert motion.trajectory(2.0).duration == 2.0
    assert np.abs(motion.trajectory(2.0)(np.linspace(0.0, 2.0, 9)) - motion.start).max() == 0.0
