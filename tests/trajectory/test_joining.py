"""Parts of motions, and their segments."""

from dataclasses import replace

import numpy as np
import pytest

from optiplan.errors import InputError
from optiplan.trajectory.joining import cut_trajectory, join_trajectories, standstill
from optiplan.trajectory.segments import Segment
from optiplan.trajectory.trajectory import Trajectory


@pytest.fixture
def motion():
    rng = np.random.default_rng(1)
    steps = (Segment(1, "move", "there", 0.0, 0.8), Segment(2, "attach", "attach it", 0.8, 0.8))
    return Trajectory(("a", "b"), np.array([0.0, 0.5, 0.8, 1.4]), rng.standard_normal((3, 6, 2)), steps)


@pytest.mark.parametrize(("begin", "end"), [(0.0, 1.4), (0.2, 0.3), (0.5, 0.8), (0.1, 1.3)])
def test_a_part_is_the_motion_in_its_own_time(motion, begin, end):
    part = cut_trajectory(motion, begin, end)
    t = np.linspace(0.0, end - begin, 44)[1:-1]
    assert part.duration == pytest.approx(end - begin)
    for order in range(4):
        assert np.allclose(part(t, order), motion(t + begin, order), atol=1e-9)


@pytest.mark.parametrize(("begin", "lasts"), [(0.5, 2e-16), (0.8, 1e-13), (0.0, 1e-18), (1.4 - 4.5e-16, 4.5e-16)])
def test_a_part_may_be_as_short_as_numbers_allow(motion, begin, lasts):
    part = cut_trajectory(motion, begin, begin + lasts)
    assert part.duration == pytest.approx(lasts, rel=0.6)
    piece = max(k for k, t in enumerate(motion.breakpoints[:-1]) if t <= begin)  # the one that begins there
    h = begin - motion.breakpoints[piece]
    assert np.allclose(part.start, sum(c * h**k for k, c in enumerate(motion.coefficients[piece])), atol=1e-12)


def test_an_empty_part_is_refused(motion):
    with pytest.raises(ValueError, match="end after the beginning"):
        cut_trajectory(motion, 0.3, 0.3)


def test_segments_are_scaled_and_stored(motion):
    slower = motion.scaled(2.8)
    assert [segment.end for segment in slower.segments] == pytest.approx([1.6, 1.6])
    data = motion.to_dict(rate=10.0)
    assert data["events"] == [{"t": 0.8, "end": 0.8, "step": 2, "kind": "attach", "name": "attach it"}]
    assert Trajectory.from_dict(data).segments == motion.segments


def test_an_event_at_the_end_is_at_the_end_at_any_speed(motion):
    """One that is a rounding behind it would never be due."""
    last = replace(motion.segments[-1], begin=motion.duration, end=motion.duration)
    motion = replace(motion, segments=(last,))
    for duration in np.linspace(0.5, 3.0, 200):
        slower = motion.scaled(duration)
        assert slower.segments[0].begin == slower.segments[0].end == slower.duration


@pytest.mark.parametrize("wrong", [3, [{"step": 1}], [{"step": 1, "kind": "a", "name": "b", "begin": "x", "end": 1}]])
def test_broken_segments_are_refused(motion, wrong):
    with pytest.raises(InputError, match="segments"):
        Trajectory.from_dict(motion.to_dict() | {"segments": wrong})


def test_a_part_between_breakpoints_a_rounding_apart():
    late = 0.5154762651049016
    times = np.array([0.0, late - 0.1, np.nextafter(late, 0.0), late, 1.0])
    motion = Trajectory(("a",), times, np.arange(8.0).reshape(4, 2, 1))
    for begin, end in ((0.1, late), (0.3, 0.9), (late - 0.1, late)):
        part = cut_trajectory(motion, begin, end)
        assert part.duration == end - begin
        np.testing.assert_allclose(part.start, motion(begin))


def test_a_piece_that_rounding_takes_away_is_left_out():
    """The time between its ends is a rounding error; later, or at another speed, they are one."""
    late = 1.9
    times = np.array([0.0, late, np.nextafter(late, 2.0), 2.0])
    motion = Trajectory(("a",), times, np.array([[[0.0], [1.0]], [[late], [1.0]], [[late], [1.0]]]))
    for slower in np.linspace(1.0, 4.0, 50):
        scaled = motion.scaled(slower * motion.duration)
        assert scaled.duration == pytest.approx(2.0 * slower, rel=1e-15)
        np.testing.assert_allclose(scaled.end, motion.end)
    joined = join_trajectories([standstill(("a",), np.zeros(1), 5.0), motion])
    assert len(joined.breakpoints) == 4
    np.testing.assert_allclose(joined(6.95), motion(1.95))
