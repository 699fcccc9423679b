import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from optiplan.trajectory.paths.parabolic_blends import (
    blends_by_acceleration,
    blends_by_time,
    run_blends,
    with_pseudo_vias,
)

NAMES = ("a", "b")


def test_craig_example():
    """Craig, 3rd edition, example 7.3, recomputed: 10, 35, 25, 10 degrees in 2, 1 and 3 s, 50 degrees/s² at blends."""
    blends = blends_by_acceleration(np.array([[10.0], [35], [25], [10]]), np.array([0.0, 2, 3, 6]), np.array([50.0]))
    assert blends.durations.ravel() == pytest.approx([0.268, 0.468, 0.098, 0.102], abs=1e-3)
    assert blends.linear.ravel() == pytest.approx([1.498, 0.717, 2.849], abs=1e-3)
    v = run_blends(np.array([10.0]), blends, ("a",))(np.array([1.0, 2.5, 4.0]), 1).ravel()
    assert v == pytest.approx([13.397, -10.0, -5.086], abs=1e-3)


def random_case(seed, count):
    rng = np.random.default_rng(seed)
    return rng.uniform(-1, 1, (count, 2)), np.concatenate([[0.0], np.cumsum(rng.uniform(1.0, 2.0, count - 1))])


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10**6), st.integers(2, 6), st.booleans())
def test_from_rest_at_the_first_point_to_rest_at_the_last(seed, count, by_time):
    points, times = random_case(seed, count)
    a = np.array([20.0, 25.0])
    blends = blends_by_time(points, times, 0.3) if by_time else blends_by_acceleration(points, times, a)
    assert blends.overlap() is None
    motion = run_blends(points[0], blends, NAMES)
    assert motion.duration == times[-1]
    assert motion.start == pytest.approx(points[0], abs=1e-12)
    assert motion.end == pytest.approx(points[-1], abs=1e-10)
    assert np.abs(motion(times[[0, -1]], 1)).max() < 1e-10
    for order in (0, 1):
        assert np.abs(motion.jumps(order)).max(initial=0.0) < 1e-10
    low, high = motion.extrema(2)
    if not by_time:
        assert (np.maximum(-low, high) <= a * (1.0 + 1e-9)).all()
    off = np.abs(motion(times) - points)
    assert off[1:-1] == pytest.approx(blends.miss[1:-1], abs=1e-9)  # |a| t² / 8
    middle = 0.5 * (times[1:] + times[:-1])
    assert np.abs(motion(middle, 2)).max() < 1e-9  # straight lines between


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10**6), st.integers(3, 6), st.booleans())
def test_vias_between_pseudo_via_points_are_hit(seed, count, by_time):
    points, times = random_case(seed, count)
    hit = np.random.default_rng(seed).random(count) < 0.6
    pseudo, pseudo_times = with_pseudo_vias(points, times, hit, 0.25)
    assert len(pseudo) == count + 2 * hit[1:-1].sum()
    blends = blends_by_time(pseudo, pseudo_times, 0.2)
    if not by_time:
        blends = blends_by_acceleration(pseudo, pseudo_times, np.array([40.0, 50.0]))
    assert blends.overlap() is None
    motion = run_blends(points[0], blends, NAMES)
    inner = np.flatnonzero(hit[1:-1]) + 1
    assert motion(times[inner]) == pytest.approx(points[inner], abs=1e-9)
    assert motion.end == pytest.approx(points[-1], abs=1e-9)


@pytest.mark.parametrize("step", [0.0, 1e-15, 1e-13, 1e-12, 1e-10])
def test_a_joint_that_hardly_moves_has_blends_next_to_nothing(step):
    points, times = np.array([[0.0, 0.0], [0.5 * step, 0.7], [step, 1.0]]), np.array([0.0, 2.0, 4.0])
    motion = run_blends(points[0], blends_by_acceleration(points, times, np.full(2, 3.0)), NAMES)
    assert motion.end == pytest.approx(points[-1], abs=1e-13)
    assert np.abs(motion(4.0, 1)).max() < 1e-13


@pytest.mark.parametrize("acceleration", [1.32, 1.35])
def test_blends_that_overlap_are_named(acceleration):
    """Half a radian there and back in 1 s each: with r = sqrt(1 - 1 / a) the straight part lasts 2 r - 1."""
    points, times = np.array([[0.0, 0.0], [0.5, 0.0], [0.0, 0.0]]), np.array([0.0, 1.0, 2.0])
    blends = blends_by_acceleration(points, times, np.full(2, acceleration))
    assert blends.linear[0, 0] == pytest.approx(2.0 * np.sqrt(1.0 - 1.0 / acceleration) - 1.0)
    assert (blends.overlap() is not None) == (acceleration < 4.0 / 3.0)
    if acceleration < 4.0 / 3.0:
        segment, joint, lack = blends.overlap()
        assert (segment, joint) == (0, 0)
        assert lack == pytest.approx(-blends.linear[0, 0])


def test_no_blend_is_strong_enough():
    points, times = np.array([[0.0, 0.0], [0.0, 1.0]]), np.array([0.0, 1.0])
    assert blends_by_acceleration(points, times, np.full(2, 3.9)).overlap() == (0, 1, np.inf)
    found = blends_by_acceleration(points, times, np.full(2, 4.0))
    assert found.overlap() is None
    assert found.durations[:, 1] == pytest.approx([0.5, 0.5])
