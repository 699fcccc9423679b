import numpy as np
import pytest

from optiplan.trajectory.timing.time_scaling import FreeTimes, least_stretch


@pytest.mark.parametrize("edge", [0.01, 0.3, 1.0, 77.0])
def test_the_least_good_factor_is_found(edge):
    assert least_stretch(lambda factor: factor >= edge) == pytest.approx(max(edge, 1.0 / 16.0), rel=1e-6)


def test_nothing_is_good():
    assert least_stretch(lambda factor: False) is None


def test_times_that_are_given_stay():
    base = np.array([0.0, 1.0, 3.0, 4.0])
    free, given = FreeTimes.of(np.empty(0), base), FreeTimes.of(np.array([2.0, 5.0]), base)
    assert free.at(2.0).tolist() == [0.0, 2.0, 6.0, 8.0]
    assert given.at(3.0).tolist() == [0.0, 2.0, 5.0, 8.0]
    assert free.at(free.factor(10.0))[-1] == pytest.approx(10.0)
    assert given.at(given.factor(10.0)).tolist() == [0.0, 2.0, 5.0, 10.0]
