"""Samples become a motion: what is passed, what comes back, what is refused."""

import numpy as np
import pytest

from optiplan.trajectory.from_samples import from_samples, interpolation
from optiplan.trajectory.paths.hermite import hermite
from optiplan.trajectory.trajectory import Trajectory

NAMES = ("a", "b")


def swing() -> Trajectory:
    """A quintic of 2 s from rest to rest."""
    states = np.zeros((2, 3, 2))
    states[1, 0] = (1.0, -0.5)
    c = hermite(states[0], states[1], np.array([2.0]))
    return Trajectory(NAMES, np.array([0.0, 2.0]), c / 2.0 ** np.arange(6)[:, None])


@pytest.mark.parametrize("given", [0, 1, 2])
def test_every_sample_is_passed_and_the_motion_comes_back(given: int) -> None:
    motion, t = swing(), np.linspace(0.0, 2.0, 201)
    samples = [motion(t, order) for order in range(given + 1)]
    found = from_samples(NAMES, t + 7.0, *samples)
    between = np.linspace(0.0, 2.0, 1111)
    for order, values in enumerate(samples):
        assert np.abs(found(t, order) - values).max() < 1e-9
    for order, exact in enumerate((1e-8, 1e-5, 1e-2) if given == 0 else (1e-10, 1e-8, 1e-6)):
        assert np.abs(found(between, order) - motion(between, order)).max() < exact
    assert found.duration == pytest.approx(2.0)
    assert np.abs(found.jumps(2)).sum() < 1e-9  # so that a limit on jerk means something
    assert np.abs(found(np.array([0.0, 2.0]), 1)).max() < 1e-12
    assert np.abs(found(np.array([0.0, 2.0]), 2)).max() < 1e-9


def test_two_positions_are_a_motion_from_rest_to_rest() -> None:
    found = from_samples(NAMES, np.array([0.0, 1.0]), np.array([[0.0, 0.0], [1.0, 2.0]]))
    assert np.abs(found(np.array([0.0, 1.0]), 1)).max() < 1e-12
    assert found.end == pytest.approx([1.0, 2.0])


def test_the_interpolation_has_a_name() -> None:
    one = np.zeros((2, 2))
    assert len({interpolation(None, None), interpolation(one, None), interpolation(one, one)}) == 3


@pytest.mark.parametrize(
    ("t", "q", "more", "field"),
    [
        ([0.0], [[0.0, 0.0]], {}, "t"),
        ([0.0, 0.0], np.zeros((2, 2)), {}, "t"),
        ([0.0, np.nan], np.zeros((2, 2)), {}, "t"),
        ([0.0, 1e-320], [[0.0, 0.0], [1.0, 1.0]], {}, "t"),
        ([0.0, 1e-100], [[0.0, 0.0], [1.0, 1.0]], {"v": np.zeros((2, 2))}, "t"),
        ([0.0, 1.0], np.zeros((2, 3)), {}, "q"),
        ([0.0, 1.0], [[0.0, np.inf], [0.0, 0.0]], {}, "q"),
        ([0.0, 1.0], np.zeros((2, 2)), {"v": np.zeros((3, 2))}, "v"),
        ([0.0, 1.0], np.zeros((2, 2)), {"a": np.zeros((2, 2))}, "a"),
    ],
)
def test_what_does_not_fit_is_refused_by_name(t: object, q: object, more: dict[str, object], field: str) -> None:
    with pytest.raises(ValueError, match=f"^{field}: found .*; expected"):
        from_samples(NAMES, t, q, **more)
