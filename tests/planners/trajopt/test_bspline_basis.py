"""The B-spline of the main planner: derivatives, hull, fit, least duration."""

import numpy as np
import pytest
from scipy.interpolate import BSpline

from optiplan.planners.trajopt.bspline_basis import DEGREE, SplineBasis, bunched_breakpoints
from optiplan.planners.trajopt.initial_guess import along_path
from optiplan.trajectory.trajectory import Trajectory


@pytest.fixture
def basis() -> SplineBasis:
    return SplineBasis(bunched_breakpoints(12, 0.6))


@pytest.fixture
def control(basis: SplineBasis) -> np.ndarray:
    return np.random.default_rng(0).normal(size=(basis.size, 3))


def test_breakpoints_increase_and_are_denser_at_the_ends() -> None:
    u = bunched_breakpoints(22, 0.6)
    assert len(u) == 23
    assert u[0] == 0.0
    assert u[-1] == 1.0
    width = np.diff(u)
    assert (width > 0).all()
    assert width[2] < 0.5 * width[11]


def test_samples_and_derivatives_equal_scipy(basis: SplineBasis, control: np.ndarray) -> None:
    u = np.linspace(0.0, 1.0, 101)
    curve = BSpline(basis.knots, control, DEGREE)
    for order in range(3):
        expected = curve.derivative(order)(u) if order else curve(u)
        np.testing.assert_allclose(basis.at(u, order) @ control, expected, atol=1e-8 * 50**order)


def test_derivative_control_points_enclose_the_derivative(basis: SplineBasis, control: np.ndarray) -> None:
    u = np.linspace(0.0, 1.0, 2001)
    for order in (1, 2, 3):
        points = basis.derivative[order] @ control
        values = BSpline(basis.knots, control, DEGREE).derivative(order)(u)
        assert (values.max(axis=0) <= points.max(axis=0) + 1e-6 * np.abs(points).max()).all()
        assert (values.min(axis=0) >= points.min(axis=0) - 1e-6 * np.abs(points).max()).all()


def test_jerk_gram_is_the_integral_of_squared_jerk(basis: SplineBasis, control: np.ndarray) -> None:
    u, weight = np.polynomial.legendre.leggauss(4)
    edges = basis.breakpoints
    half, middle = 0.5 * np.diff(edges), 0.5 * (edges[1:] + edges[:-1])
    nodes = (middle[:, None] + half[:, None] * u).ravel()
    weights = (half[:, None] * weight).ravel()
    jerk = BSpline(basis.knots, control, DEGREE).derivative(3)(nodes)
    expected = float((weights[:, None] * jerk**2).sum())
    assert np.sum(control * (basis.jerk_gram @ control)) == pytest.approx(expected, rel=1e-9)


def test_fit_is_at_rest_at_both_ends(basis: SplineBasis) -> None:
    u = np.linspace(0.0, 1.0, 200)
    points = np.column_stack([np.sin(2 * u), u**3])
    control = basis.fit(u, points)
    ends = np.array([0.0, 1.0])
    np.testing.assert_allclose(basis.at(ends) @ control, points[[0, -1]], atol=1e-12)
    for order in (1, 2):
        np.testing.assert_allclose(basis.at(ends, order) @ control, 0.0, atol=1e-8)


def test_shortest_duration_meets_the_tightest_limit(basis: SplineBasis, control: np.ndarray) -> None:
    limits = (np.full(3, 2.0), np.full(3, 10.0), np.full(3, 500.0))
    T = basis.shortest_duration(control, limits)
    shares = [float((np.abs(basis.bounded[r - 1] @ control) / T**r / limits[r - 1]).max()) for r in (1, 2, 3)]
    assert max(shares) == pytest.approx(1.0)


def test_seed_follows_the_path(basis: SplineBasis) -> None:
    waypoints = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]])
    curve = basis.at(np.linspace(0, 1, 300)) @ along_path(basis, waypoints, np.ones(2))
    off = np.minimum(np.abs(curve[:, 1]), np.abs(curve[:, 0] - 1.0))
    assert off.max() < 0.15
    np.testing.assert_allclose(curve[[0, -1]], waypoints[[0, -1]], atol=1e-12)


def test_its_motion_is_that_of_its_control_points(basis: SplineBasis, control: np.ndarray) -> None:
    names = tuple(f"joint_{j}" for j in range(control.shape[1]))
    found, same = (
        basis.trajectory(names, control, 1.7),
        Trajectory.from_bspline(names, 1.7 * basis.knots, control, DEGREE),
    )
    np.testing.assert_allclose(found.breakpoints, same.breakpoints, rtol=0.0, atol=1e-15)
    np.testing.assert_allclose(found.coefficients, same.coefficients, rtol=1e-12, atol=1e-9)
