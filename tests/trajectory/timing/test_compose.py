"""q(s(t)): exact, smooth, and honest about laws that are none."""

import numpy as np
import pytest

from optiplan.trajectory.polynomial import shifted
from optiplan.trajectory.timing.compose import compose
from optiplan.trajectory.timing.s_curve import s_curve
from optiplan.trajectory.trajectory import Trajectory
from tests.trajectory.sample_paths import PATHS


def law_over(length, bounds=(1.3, 4.0, 30.0)):
    times, pieces = s_curve(length, *bounds)
    return Trajectory(("s",), np.concatenate([[0.0], np.cumsum(times)]), pieces[:, :, None])


def spline_law(length):
    """Many uneven pieces, with a halt in the middle."""
    s = length * np.concatenate([[0, 0], np.linspace(0, 1, 20) ** 2 * 0.5, [0.5, 0.5, 0.5], np.linspace(0.5, 1, 20)])
    control = np.concatenate([s, [length, length]])[:, None]
    return Trajectory.from_bspline(("s",), np.arange(len(control) + 4) * 0.031, control, 3)


@pytest.mark.parametrize("name", PATHS)
@pytest.mark.parametrize("make", [law_over, spline_law])
def test_composition_is_exact_with_its_derivatives(name, make):
    path = PATHS[name]
    law = make(path.duration)
    motion = compose(path, law)
    t = np.linspace(0.0, law.duration, 4001)
    s, v, a, j = (law(t, order) for order in range(4))
    s = np.clip(s[:, 0], 0.0, path.duration)
    q, q1, q2, q3 = (path(s, order) for order in range(4))
    assert np.abs(motion(t) - q).max() < 1e-12
    chain = [q1 * v, q1 * a + q2 * v**2, q1 * j + 3.0 * q2 * v * a + q3 * v**3]
    near = np.abs(t[:, None] - motion.breakpoints).min(axis=1) < 1e-9  # the third derivative jumps there
    for order, expected in enumerate(chain, 1):
        kept = slice(None) if order < 3 else ~near
        scale = np.abs(expected).max()
        assert np.abs(motion(t, order) - expected)[kept].max() < 1e-9 * scale, order


@pytest.mark.parametrize("name", PATHS)
def test_composition_is_as_smooth_as_its_parts(name):
    path = PATHS[name]
    motion = compose(path, law_over(path.duration))
    for order, allowed in ((0, 1e-12), (1, 1e-11), (2, 1e-8)):
        assert np.abs(motion.jumps(order)).max() < allowed
    assert np.abs(motion.end - path.end).max() < 1e-12
    degree = motion.coefficients.shape[1] - 1
    assert degree == 3 * max(k for k in range(path.coefficients.shape[1]) if path.coefficients[:, k].any())


def test_breakpoints_of_path_and_law_that_coincide_are_one():
    path = Trajectory(("a",), np.array([0.0, 1.0, 2.0]), np.array([[[0.0], [1.0]], [[1.0], [3.0]]]))
    law = Trajectory(("s",), np.array([0.0, 1.0 + 1e-14, 2.0]), np.array([[[0.0], [1.0]], [[1.0 + 1e-14], [1.0]]]))
    motion = compose(path, law)
    assert len(motion.breakpoints) == 3
    assert motion(np.array([0.5, 1.5]))[:, 0] == pytest.approx([0.5, 2.5], abs=1e-12)


def test_shifted_moves_the_origin():
    c = np.array([[[1.0], [-2.0], [0.5], [3.0]]])
    tau = np.linspace(-1.0, 1.0, 7)
    value = lambda c, x: sum(c[0, k, 0] * x**k for k in range(4))  # noqa: E731
    assert value(shifted(c, np.array([0.7])), tau) == pytest.approx(value(c, tau + 0.7))


@pytest.mark.parametrize(
    ("law", "reason"),
    [
        (Trajectory(("x", "y"), np.array([0.0, 1.0]), np.zeros((1, 1, 2))), "2 columns"),
        (Trajectory(("s",), np.array([0.0, 1.0]), np.array([[[0.0], [9.0]]])), "within"),
        (Trajectory(("s",), np.array([0.0, 1.0]), np.array([[[1.0], [-1.0]]])), "never to decrease"),
    ],
)
def test_a_law_that_is_none_is_refused(law, reason):
    with pytest.raises(ValueError, match=reason):
        compose(PATHS["rounded"], law)
