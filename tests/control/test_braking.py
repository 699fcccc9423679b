"""Stops in closed form against the rule that they come from, step by step."""

import math

import numpy as np
import pytest

from optiplan.control.braking import (
    braking_acceleration,
    braking_accelerations,
    farthest,
    stop_phases,
    travel,
    velocity_to_zero,
)


def rolled_out(v, a, limit, change, dt):
    """Travel, and the farthest point ahead, of the rule a' = -sign(v) F⁻¹(|v|) within its limits."""
    way = ahead = 0.0
    for _ in range(100_000):
        if abs(v) < 1e-12 and abs(a) <= change * (1.0 + 1e-9):
            return way, ahead
        wanted = -math.copysign(braking_acceleration(abs(v), change, dt), v)
        a = min(max(wanted, max(a - change, -limit)), min(a + change, limit))
        v += dt * a
        way += dt * v
        ahead = max(ahead, way)
    raise AssertionError("it does not stop")


def cases(count):
    rng = np.random.default_rng(0)
    for _ in range(count):
        dt, limit = rng.choice([1e-3, 2e-3, 1e-2]), rng.uniform(0.5, 20.0)
        jerk = math.inf if rng.random() < 0.15 else limit * rng.uniform(2.0, 1000.0)
        yield rng.uniform(-3, 3) * rng.choice([1.0, 0.01, 0.0]), rng.uniform(-limit, limit), limit, jerk * dt, dt


def test_travel_is_that_of_the_rule():
    for v, a, limit, change, dt in cases(1500):
        way, ahead = rolled_out(v, a, limit, change, dt)
        phases = stop_phases(v, a, limit, change, dt)
        assert len(phases) <= 3
        assert travel(phases, v, dt) == pytest.approx(way, abs=1e-10)
        assert farthest(v, a, limit, change, dt) == pytest.approx(ahead, abs=1e-10)


def test_what_is_left_of_a_stop_is_the_stop_from_there():
    for v, a, limit, change, dt in cases(300):
        wanted = -math.copysign(braking_acceleration(abs(v), change, dt), v)
        after = min(max(wanted, max(a - change, -limit)), min(a + change, limit))
        whole = travel(stop_phases(v, a, limit, change, dt), v, dt)
        left = travel(stop_phases(v + dt * after, after, limit, change, dt), v + dt * after, dt)
        assert dt * (v + dt * after) + left == pytest.approx(whole, abs=1e-10)


def test_inverse_of_velocity_to_zero():
    rng = np.random.default_rng(1)
    for u, change in rng.uniform(0.0, 2.0, (200, 2)):
        assert velocity_to_zero(braking_acceleration(u, change, 0.001), change, 0.001) == pytest.approx(u, abs=1e-12)
    u, change = rng.uniform(0.0, 2.0, 50), np.append(rng.uniform(0.1, 5.0, 49), np.inf)
    one_by_one = [braking_acceleration(*pair, 0.002) for pair in zip(u.tolist(), change.tolist(), strict=True)]
    assert np.allclose(braking_accelerations(u, change, 0.002), one_by_one, rtol=1e-12)
