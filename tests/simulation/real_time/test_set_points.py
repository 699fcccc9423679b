"""The reference of a simulated drive: no jumps where set-points come late, early or not at all."""

import numpy as np
import pytest

from optiplan.simulation.real_time.set_points import ReceivedSetPoints, between

PERIOD, SILENCE, CLOCK = 2e-3, 6e-3, 1000.0


def motion(t):
    """A joint that swings, and its rates."""
    return np.array([np.sin(3.0 * t)]), np.array([3.0 * np.cos(3.0 * t)]), np.array([-9.0 * np.sin(3.0 * t)])


def way(t0, t1):
    t = np.linspace(t0, t1, 60)
    return (t, *(np.array([motion(one)[k] for one in t]) for k in range(3)))


def test_quintics_meet_their_samples_and_what_lies_between():
    samples = way(0.0, 0.3)
    for time in np.linspace(-0.1, 0.4, 300):
        wanted = motion(min(max(time, 0.0), 0.3))
        got = between(*samples, time)
        assert np.allclose(got[0], wanted[0], atol=1e-10)
        assert np.allclose(got[1], wanted[1], atol=1e-7)
        assert np.allclose(got[2], wanted[2], atol=1e-4)


@pytest.mark.parametrize("seed", range(3))
def test_delays_of_set_points_do_not_shake_the_reference(seed):
    random = np.random.default_rng(seed)
    reference = ReceivedSetPoints(motion(0.0)[0], SILENCE)
    worst, sent = 0.0, []
    reference.take_ahead(*way(0.0, 2.0))
    for k in range(500):
        t = k * PERIOD
        sent.append((t, CLOCK + t + random.exponential(1e-3) + 1e-4))
        reference.take(t, *motion(t), sent[-1][1])
        if k > 200:  # it has found the clocks' distance
            now = CLOCK + t
            worst = max(worst, abs(float(reference.at(now)[0][0] - motion(t)[0][0])))
    assert worst < 3.0 * 6e-4


def test_without_set_points_it_follows_the_way_ahead_without_a_jump():
    reference = ReceivedSetPoints(motion(0.0)[0], SILENCE)
    reference.take_ahead(*way(0.0, 0.2))
    for k in range(50):
        reference.take(k * PERIOD, *motion(k * PERIOD), CLOCK + k * PERIOD)
    q = np.array([reference.at(CLOCK + t)[0][0] for t in np.arange(0.098, 0.25, 1e-4)])
    assert np.abs(np.diff(q)).max() < 3.1e-4 + 1e-6
    assert q[-1] == motion(0.2)[0][0]
    assert reference.rests(CLOCK + 0.21)
    assert not reference.rests(CLOCK + 0.15)


def test_without_a_way_ahead_it_does_not_run_away():
    reference = ReceivedSetPoints(motion(0.0)[0], SILENCE)
    assert reference.at(CLOCK)[0] == motion(0.0)[0]
    reference.take(0.1, *motion(0.1), CLOCK)
    assert abs(float(reference.at(CLOCK + 10.0)[0][0] - motion(0.1)[0][0])) < 3.0 * SILENCE
