"""The distance of two clocks, of stamps with delays."""

import numpy as np

from optiplan.execution.loop.clock_offset import ClockOffset


def test_the_smallest_delay_counts():
    random, clocks = np.random.default_rng(1), ClockOffset()
    found = [clocks.take(1000.0 + t + 1e-3 + random.exponential(2e-3), t) for t in np.arange(0.0, 4.0, 0.01)]
    assert abs(np.mean(found[100:]) - 1000.001) < 1e-3
    assert max(found[100:]) < 1000.004


def test_a_clock_that_was_set_back_is_found_again():
    clocks = ClockOffset()
    for k in range(50):
        clocks.take(10.0 + 0.01 * k, 0.01 * k)
    for k in range(50, 400):
        found = clocks.take(15.0 + 0.01 * k, 0.01 * k)
    assert abs(found - 15.0) < 0.01
