"""Curves to start from: where they begin and end, what they keep, how they differ."""

from dataclasses import replace

import numpy as np
import pytest

from optiplan.planners.trajopt.bspline_basis import FIXED, SplineBasis, bunched_breakpoints
from optiplan.planners.trajopt.initial_guess import along_path, with_bump
from optiplan.robot.robot import Limits
from tests.planners import cases

U = np.linspace(0.0, 1.0, 401)


@pytest.fixture(scope="module")
def basis() -> SplineBasis:
    return SplineBasis(bunched_breakpoints(22, 0.6))


@pytest.fixture(scope="module")
def limits() -> Limits:
    return cases.robot("panda").limits


@pytest.fixture(scope="module")
def line(basis: SplineBasis, limits: Limits) -> np.ndarray:
    return along_path(basis, np.array([cases.READY, cases.LEFT]), limits.velocity)


def test_a_seed_along_a_path_stays_near_it(basis: SplineBasis, limits: Limits) -> None:
    middle = 0.5 * (cases.READY + cases.LEFT) + 0.3
    way = np.array([cases.READY, middle, cases.LEFT])
    control = along_path(basis, way, limits.velocity)
    np.testing.assert_allclose(control[:FIXED], np.tile(way[0], (FIXED, 1)), atol=1e-12)
    np.testing.assert_allclose(control[-FIXED:], np.tile(way[-1], (FIXED, 1)), atol=1e-12)
    Q = basis.at(U) @ control
    assert np.linalg.norm(Q - middle, axis=1).min() < 0.1


@pytest.mark.parametrize("seed", range(20))
def test_a_bump_keeps_the_ends_and_the_limits(basis: SplineBasis, limits: Limits, line: np.ndarray, seed: int) -> None:
    """Within limits so tight that most bumps would leave them."""
    tight = replace(limits, lower=line.min(axis=0) - 0.05, upper=line.max(axis=0) + 0.05)
    bumped = with_bump(basis, line, 1.0, tight, np.random.default_rng(seed))
    np.testing.assert_array_equal(bumped[:FIXED], line[:FIXED])
    np.testing.assert_array_equal(bumped[-FIXED:], line[-FIXED:])
    assert (bumped >= tight.lower).all()
    assert (bumped <= tight.upper).all()
    assert np.abs(bumped - line).max() > 1e-3


def test_bumps_are_smooth_local_and_of_the_stated_size(basis: SplineBasis, limits: Limits, line: np.ndarray) -> None:
    wide = replace(limits, lower=np.full(7, -np.inf), upper=np.full(7, np.inf))
    rng = np.random.default_rng(0)
    moved = [with_bump(basis, line, 2.0, wide, rng) - line for _ in range(400)]
    assert all((np.ptp(change, axis=0) > 0.0).all() for change in moved), "every joint takes part"
    assert min(np.count_nonzero(change.any(axis=1)) for change in moved) < len(line) / 2, "some are local"
    peaks = np.array([np.abs(change).max(axis=0) for change in moved]) / (2.0 * limits.velocity)
    # |normal| of 0.15 has the mean 0.15 sqrt(2 / pi); control points may miss the top of the cosine.
    assert peaks.mean() == pytest.approx(0.15 * np.sqrt(2.0 / np.pi), rel=0.15)


def test_bumps_repeat_with_the_seed_alone(basis: SplineBasis, limits: Limits, line: np.ndarray) -> None:
    one, same, other = (with_bump(basis, line, 1.0, limits, np.random.default_rng(seed)) for seed in (4, 4, 5))
    np.testing.assert_array_equal(one, same)
    assert not np.array_equal(one, other)
