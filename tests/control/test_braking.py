"""Stops in closed form against the motion that they stand for, followed in small steps."""

import math

import numpy as np
import pytest

from optiplan.control.braking import (
    after,
    braking_accelerations,
    farthest,
    farthest_way,
    stop_phases,
    travel,
    velocity_to_zero,
)
from optiplan.control.limits.joint_box import JointEnd, fastest_velocity


def rolled_out(v, a, limit, jerk, parts=400):
    """Positions of the stop, with acceleration and jerk held against their limits on the way."""
    q, Q = 0.0, [0.0]
    for lasting, first, change in stop_phases(v, a, limit, jerk):
        assert lasting >= 0.0
        t = np.linspace(0.0, lasting, parts)
        assert (np.abs(first + change * t) <= limit * (1.0 + 1e-12)).all()
        assert abs(change) in (0.0, jerk)
        if math.isfinite(jerk):
            assert first == pytest.approx(a, abs=1e-9), "the acceleration goes on from what it was"
        Q += (q + v * t + first * t**2 / 2 + change * t**3 / 6).tolist()
        q, v, a = Q[-1], v + first * lasting + change * lasting**2 / 2, first + change * lasting
    assert v == pytest.approx(0.0, abs=1e-10), "it stands"
    if math.isfinite(jerk):
        assert a == pytest.approx(0.0, abs=1e-9), "and stays"
    return np.array(Q)


def cases(count):
    rng = np.random.default_rng(0)
    for _ in range(count):
        limit = rng.uniform(0.5, 20.0)
        jerk = math.inf if rng.random() < 0.15 else limit * rng.uniform(2.0, 1000.0)
        yield rng.uniform(-3, 3) * rng.choice([1.0, 0.01, 0.0]), rng.uniform(-limit, limit), limit, jerk


def test_a_stop_keeps_its_limits_and_ends_where_it_says():
    for v, a, limit, jerk in cases(1500):
        phases, Q = stop_phases(v, a, limit, jerk), rolled_out(v, a, limit, jerk)
        assert len(phases) <= 3
        assert travel(phases, v) == pytest.approx(Q[-1], abs=1e-10)
        coarse = 2e-3 * np.ptp(Q) + 1e-10
        assert Q.max() - 1e-10 <= farthest(v, a, limit, jerk) <= Q.max() + coarse
        assert np.abs(Q).max() - 1e-10 <= farthest_way(phases, v, a, limit, jerk) <= np.abs(Q).max() + coarse


def test_what_is_left_of_a_stop_is_the_stop_from_there():
    """After any time: so a robot that can stop can go on along its stop, however long the next step is."""
    rng = np.random.default_rng(2)
    for v, a, limit, jerk in cases(300):
        phases = stop_phases(v, a, limit, jerk)
        q, later_v, later_a = after(phases, 0.0, v, rng.uniform(0.0, 0.3))
        rest = travel(stop_phases(later_v, later_a, limit, jerk), later_v)
        assert q + rest == pytest.approx(travel(phases, v), abs=1e-9)


def test_inverse_of_velocity_to_zero():
    rng = np.random.default_rng(1)
    u, jerk = rng.uniform(0.0, 2.0, 200), np.append(rng.uniform(0.1, 5000.0, 199), np.inf)
    found = braking_accelerations(u, jerk, 0.002)
    back = [velocity_to_zero(*pair, 0.002) for pair in zip(found.tolist(), jerk.tolist(), strict=True)]
    np.testing.assert_allclose(back, u, atol=1e-12)


@pytest.mark.parametrize("by_acceleration", [False, True])
def test_before_an_end_there_is_a_next_step_of_any_length(by_acceleration):
    """The fastest velocity before an end is found at both ends at once, step after step, and no end is passed."""
    rng, longest = np.random.default_rng(3), 0.1
    for _ in range(60):
        limit, top = rng.uniform(0.5, 15.0), rng.uniform(0.5, 3.0)
        end = JointEnd(limit, limit * 10.0 ** rng.uniform(0.5, 3.0), 0.5 * longest * by_acceleration)
        low_end, high_end = -rng.uniform(0.02, 1.0), rng.uniform(0.02, 1.0)
        q = v = a = 0.0
        for _ in range(150):
            dt = longest * float(rng.choice([1.0, rng.uniform(1e-3, 1.0), 0.1]))
            moves = dt * (0.5 if by_acceleration else 1.0)
            change = end.jerk * dt
            low, high = v + dt * max(a - change, -limit), v + dt * min(a + change, limit)
            ahead, behind = high_end - q - (dt - moves) * v, q - low_end + (dt - moves) * v
            most = fastest_velocity(end, ahead, v, (dt, moves), (low, high))
            least = -fastest_velocity(end, behind, -v, (dt, moves), (-high, -low))
            assert least <= most + 1e-9
            x = float(np.clip(rng.choice([most, least, rng.uniform(least, most), top]), min(least, most), most))
            q, v, a = q + (dt - moves) * v + moves * x, x, (x - v) / dt
            assert low_end - 1e-8 <= q <= high_end + 1e-8
