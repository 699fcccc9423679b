"""The trajectory: evaluation, exact extrema, jumps, B-splines, JSON, and what it refuses."""

import json
from itertools import pairwise
from math import comb

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import BSpline

from optiplan.errors import InputError
from optiplan.trajectory import trajectory
from optiplan.trajectory.trajectory import Trajectory


def random_trajectory(seed, m=5, degree=4, n=3):
    rng = np.random.default_rng(seed)
    breakpoints = np.concatenate([[0.0], np.cumsum(rng.uniform(0.01, 0.5, m))])
    return Trajectory(tuple(f"j{j}" for j in range(n)), breakpoints, rng.normal(size=(m, degree + 1, n)))


def test_values_are_the_formula_of_the_docstring():
    traj = random_trajectory(1)
    t = np.linspace(0.0, traj.duration, 57)
    for time, q in zip(t, traj(t), strict=True):
        i = min(np.searchsorted(traj.breakpoints, time, side="right") - 1, 4)
        terms = [traj.coefficients[i, k] * (time - traj.breakpoints[i]) ** k for k in range(5)]
        np.testing.assert_allclose(q, sum(terms), atol=1e-12)


@pytest.mark.parametrize("order", [0, 1, 2])
def test_next_order_is_the_derivative_by_differences(order):
    traj = random_trajectory(2)
    t = 0.5 * (traj.breakpoints[:-1] + traj.breakpoints[1:])
    slope = (traj(t + 1e-6, order) - traj(t - 1e-6, order)) / 2e-6
    np.testing.assert_allclose(traj(t, order + 1), slope, rtol=1e-6, atol=1e-6)


def test_derivatives_beyond_the_degree_are_zero():
    traj = random_trajectory(3, degree=1)
    assert not traj(np.linspace(0, traj.duration, 9), 3).any()
    assert not np.any(traj.extrema(3))


def test_start_end_and_times_just_outside():
    traj = random_trajectory(4)
    np.testing.assert_array_equal(traj.start, traj(np.array([-1e-10]))[0])
    np.testing.assert_array_equal(traj.end, traj(np.array([traj.duration + 1e-10]))[0])


@pytest.mark.parametrize("t", [-1e-6, 99.0, np.nan])
def test_times_outside_are_refused(t):
    with pytest.raises(ValueError, match="expected times in"):
        random_trajectory(4)(np.array([0.1, t]))


@pytest.mark.parametrize("order", range(4))
def test_clamped_times_let_the_robot_stand_at_the_nearer_end(order):
    """Of q(min(max(t, 0), T)): the ends themselves belong to the motion, beyond them nothing moves."""
    traj = random_trajectory(4)
    t = np.array([-np.inf, -0.5, 0.0, 0.3 * traj.duration, traj.duration, traj.duration + 1e-6, 99.0, np.inf])
    found = traj(t, order, clamp=True)
    np.testing.assert_array_equal(found[2:5], traj(t[2:5], order))
    for k, end in ((0, traj.start), (1, traj.start), (5, traj.end), (6, traj.end), (7, traj.end)):
        np.testing.assert_array_equal(found[k], end if order == 0 else np.zeros(traj.n))
    assert np.abs(found[4]).max() > 0.0


def test_a_time_that_is_no_number_is_refused_even_if_clamped():
    with pytest.raises(ValueError, match="found \\[nan"):
        random_trajectory(4)(np.array([0.1, np.nan]), clamp=True)


@settings(max_examples=150, deadline=None)
@given(st.integers(0, 10**6), st.integers(0, 7), st.integers(0, 3), st.sampled_from([0.0, 1e-17, 1e-12, 1e-8, 1.0]))
def test_extrema_bound_dense_samples_and_are_reached(seed, degree, order, leading):
    """Also where the leading coefficients vanish or almost do."""
    traj = random_trajectory(seed, m=3, degree=degree)
    c = traj.coefficients.copy()
    c[:, -2:] *= leading
    traj = Trajectory(traj.joint_names, traj.breakpoints, c)
    e = traj.extrema_at(order)
    values = traj(np.linspace(0, traj.duration, 2001), order)
    ends = [one_sided(traj, i, order) for i in range(3)]
    scale = 1e-12 * (1.0 + np.abs(values).max())
    assert (values.min(axis=0) >= e.low - scale).all()
    assert (values.max(axis=0) <= e.high + scale).all()
    for t, worst in [(e.t_low, e.low), (e.t_high, e.high)]:
        reached = np.concatenate([traj(t, order)[range(3), range(3)][None], *ends])
        assert (np.abs(reached - worst).min(axis=0) <= 1e-9 * (1.0 + np.abs(worst))).all()


def one_sided(traj, i, order):
    """Limits of piece i at its two ends, (2, n)."""
    h = traj.breakpoints[i + 1] - traj.breakpoints[i]
    c = traj.derivatives(order)[i]
    return np.stack([c[0], sum(c[k] * h**k for k in range(len(c)))])


@settings(max_examples=60, deadline=None)
@given(st.lists(st.floats(-0.2, 1.2), min_size=1, max_size=6))
def test_extrema_of_polynomials_with_chosen_critical_points(roots):
    """Roots may coincide: then the derivative has no change of sign, or a flat one."""
    slope = np.polynomial.polynomial.polyfromroots(roots)
    c = np.polynomial.polynomial.polyint(slope)
    traj = Trajectory(("j",), np.array([0.0, 1.0]), c[None, :, None])
    candidates = np.array([0.0, 1.0] + [r for r in roots if 0 <= r <= 1])
    values = np.polynomial.polynomial.polyval(candidates, c)
    low, high = traj.extrema(0)
    np.testing.assert_allclose([low[0], high[0]], [values.min(), values.max()], atol=1e-12)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**6), st.integers(1, 7))
def test_extrema_lie_within_the_control_polygon(seed, degree):
    """Bernstein coefficients bound a polynomial whatever its roots: an independent outer bound."""
    traj = random_trajectory(seed, m=1, degree=degree, n=2)
    c = traj.coefficients[0] * traj.duration ** np.arange(degree + 1)[:, None]
    bernstein = [sum(comb(i, k) / comb(degree, k) * c[k] for k in range(i + 1)) for i in range(degree + 1)]
    low, high = traj.extrema(0)
    assert (low >= np.min(bernstein, axis=0) - 1e-12).all()
    assert (high <= np.max(bernstein, axis=0) + 1e-12).all()


def test_a_peak_between_samples_is_found():
    """A parabola that rises from and falls to zero within a millisecond."""
    c = np.zeros((3, 3, 1))
    c[1, :, 0] = [0.0, 4e3, -4e6]  # 1 at half a millisecond
    traj = Trajectory(("j",), np.array([0.0, 1.0, 1.001, 2.0]), c)
    e = traj.extrema_at(0)
    assert e.high[0] == pytest.approx(1.0)
    assert e.t_high[0] == pytest.approx(1.0005, abs=1e-9)


def test_jumps():
    c = np.zeros((2, 3, 2))
    c[0, :, 0] = [0.0, 1.0, 2.0]
    c[1, :, 0] = [3.5, 5.0, 2.0]
    traj = Trajectory(("a", "b"), np.array([0.0, 1.0, 2.0]), c)
    np.testing.assert_allclose([traj.jumps(k)[0, 0] for k in range(4)], [0.5, 0.0, 0.0, 0.0], atol=1e-14)
    assert not traj.jumps(0)[:, 1].any()


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6), st.integers(1, 7), st.booleans())
def test_bspline_is_exact(seed, degree, clamped):
    rng = np.random.default_rng(seed)
    count = degree + 6
    knots = np.sort(rng.uniform(0.5, 3.0, count + degree + 1))
    if clamped:
        knots[: degree + 1], knots[-degree - 1 :] = knots[degree], knots[-degree - 1]
    control = rng.normal(size=(count, 2))
    traj = Trajectory.from_bspline(("a", "b"), knots, control, degree)
    spline = BSpline(knots, control, degree)
    assert traj.duration == pytest.approx(knots[-degree - 1] - knots[degree])
    t = np.linspace(0.0, traj.duration, 40)[1:-1]
    for order in range(min(degree, 4)):
        expected = spline(t + knots[degree], order)
        np.testing.assert_allclose(traj(t, order), expected, rtol=1e-6, atol=1e-6 * np.abs(expected).max())


def test_bspline_with_repeated_inner_knots_and_joins():
    knots = np.array([0, 0, 0, 0, 1, 1, 2, 3, 3, 3, 3.0])
    control = np.random.default_rng(0).normal(size=(7, 2))
    traj = Trajectory.from_bspline(("a", "b"), knots, control, 3)
    np.testing.assert_array_equal(traj.breakpoints, [0, 1, 2, 3])
    assert np.abs(traj.jumps(1)).max() < 1e-12
    assert np.abs(traj.jumps(2)[1]).max() < 1e-12
    np.testing.assert_allclose(traj.end, control[-1])


@pytest.mark.parametrize(
    ("knots", "shape", "degree", "field"),
    [
        ([0, 0, 1, 1], (2, 1), 0, "degree"),
        ([0, 0, 1, 1], (2, 1), 2, "control_points"),
        ([0, 0, 1], (2, 1), 1, "knots"),
        ([0, 1, 0.5, 2], (2, 1), 1, "decrease"),
        ([0, 1, 1, 2], (2, 1), 1, "empty"),
        ([0, 0, np.nan, 1], (2, 1), 1, "finite"),
    ],
)
def test_bad_bsplines_are_refused(knots, shape, degree, field):
    with pytest.raises(ValueError, match=field):
        Trajectory.from_bspline(("a",), np.array(knots, float), np.ones(shape), degree)


def test_scaling_divides_each_derivative_by_a_power():
    traj = random_trajectory(7)
    slow = traj.scaled(2.5 * traj.duration)
    t = np.linspace(0.0, traj.duration, 23)
    assert slow.duration == pytest.approx(2.5 * traj.duration)
    for order in range(3):
        np.testing.assert_allclose(slow(2.5 * t, order), traj(t, order) / 2.5**order, rtol=1e-9, atol=1e-9)
    with pytest.raises(InputError, match=r"Trajectory: duration: found the float 0\.0"):
        traj.scaled(0.0)


@pytest.mark.parametrize("degree", range(7))
def test_squared_jerk_is_the_integral_by_quadrature(degree):
    """Gauss-Legendre with eight nodes a piece is exact to degree 15; below degree 3 there is no jerk."""
    traj = random_trajectory(degree, degree=degree)
    nodes, weights = np.polynomial.legendre.leggauss(8)
    total = 0.0
    for begin, end in pairwise(traj.breakpoints):
        t = 0.5 * (begin + end) + 0.5 * (end - begin) * nodes
        total += 0.5 * (end - begin) * float(weights @ (traj(t, 3) ** 2).sum(axis=1))
    assert traj.squared_jerk() == pytest.approx(total, rel=1e-12, abs=1e-12)
    assert (traj.squared_jerk() > 0.0) == (degree >= 3)
    assert traj.scaled(2.0 * traj.duration).squared_jerk() == pytest.approx(total / 2.0**5, rel=1e-9)


def test_json_is_lossless():
    traj = random_trajectory(8)
    again = Trajectory.from_dict(json.loads(json.dumps(traj.to_dict(rate=100.0))))
    assert again.joint_names == traj.joint_names
    np.testing.assert_array_equal(again.breakpoints, traj.breakpoints)
    np.testing.assert_array_equal(again.coefficients, traj.coefficients)


def test_json_samples():
    traj = random_trajectory(8)
    data = traj.to_dict(rate=100.0)
    t = np.array(data["t"])
    assert np.diff(t).max() <= 0.01
    for order, key in enumerate("qva"):
        np.testing.assert_array_equal(data[key], traj(t, order))


def change(data, path, value):
    for key in path[:-1]:
        data = data[key]
    data[path[-1]] = value


@pytest.mark.parametrize(
    ("path", "value", "field"),
    [
        (["pieces"], None, "pieces"),
        (["joint_names"], "abc", "joint_names"),
        (["joint_names"], ["j0", "j1", "j1"], "joint_names"),
        (["joint_names"], ["j0", "j1", "j\npopup(2)"], "joint_names"),
        (["joint_names"], ["j0"], "pieces.coefficients"),
        (["pieces", "breakpoints"], [0.0], "pieces.breakpoints"),
        (["pieces", "breakpoints", 0], 0.1, "pieces.breakpoints"),
        (["pieces", "breakpoints", 1], float("nan"), "pieces.breakpoints"),
        (["pieces", "breakpoints", 2], 0.0, "pieces.breakpoints"),
        (["pieces", "coefficients", 0, 0, 0], float("inf"), "pieces.coefficients"),
        (["pieces", "coefficients", 0, 0, 0], None, "pieces.coefficients"),
        (["pieces", "coefficients", 0, 0, 0], "1", "pieces.coefficients"),
        (["pieces", "coefficients", 0, 0], [1.0], "pieces.coefficients"),
        (["pieces", "coefficients"], [], "pieces.coefficients"),
    ],
)
def test_bad_json_names_the_field(path, value, field):
    data = random_trajectory(9).to_dict()
    change(data, path, value)
    with pytest.raises(InputError) as error:
        Trajectory.from_dict(data, "run/trajectory.json")
    assert [issue.field for issue in error.value.issues] == [field]
    assert str(error.value).startswith("run/trajectory.json: ")


def test_other_json_is_refused():
    with pytest.raises(InputError, match="pieces"):
        Trajectory.from_dict([1, 2])


def test_construction_refuses_what_is_not_a_trajectory():
    with pytest.raises(ValueError, match="coefficients"):
        Trajectory(("a",), np.array([0.0, 1.0]), np.full((1, 2, 1), np.nan))
    with pytest.raises(ValueError, match="degree 32"):
        Trajectory(("a",), np.array([0.0, 1.0]), np.zeros((1, 33, 1)))


def test_arrays_are_copies_and_read_only():
    breakpoints = np.array([0.0, 1.0])
    traj = Trajectory(("a",), breakpoints, np.ones((1, 2, 1)))
    breakpoints[1] = 5.0
    assert traj.duration == 1.0
    with pytest.raises(ValueError, match="read-only"):
        traj.coefficients[0, 0, 0] = 2.0


def test_negative_order_is_refused():
    with pytest.raises(ValueError, match="order"):
        random_trajectory(1)(np.array([0.1]), -1)


@pytest.mark.parametrize("degree", range(8))
def test_extrema_are_the_same_without_the_core(degree, monkeypatch):
    traj = random_trajectory(degree, m=5, degree=degree)
    native = [traj.extrema_at(order) for order in range(4)]
    monkeypatch.setattr(trajectory, "core", None)
    plain = Trajectory(traj.joint_names, traj.breakpoints, traj.coefficients)
    for order, found in enumerate(native):
        e = plain.extrema_at(order)
        np.testing.assert_allclose([found.low, found.high], [e.low, e.high], rtol=1e-13, atol=1e-13)
        np.testing.assert_allclose([found.t_low, found.t_high], [e.t_low, e.t_high], rtol=0.0, atol=1e-9)


def test_names_are_no_markup_in_a_notebook():
    html = Trajectory(("<b>a</b>",), [0.0, 1.0], [[[0.0], [1.0]]])._repr_html_()
    assert "1 joints: &lt;b&gt;a&lt;/b&gt;</p>" in html
    assert "<b>" not in html
