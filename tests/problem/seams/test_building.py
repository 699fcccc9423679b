"""Curves of paths: lengths, corners, arcs and splines beside what they are made of, and bounds that hold."""

import numpy as np
import pytest

from optiplan.problem.seams.building import SeamShape
from optiplan.problem.seams.curve import SeamCurve
from optiplan.problem.seams.elements import knots_of

SQUARE = np.array([[0.0, 0, 0], [0.3, 0, 0], [0.3, 0.2, 0], [0.0, 0.2, 0.1]])
DOWN = np.array([0.0, 0, -1])


def shape(points=SQUARE, **keys):
    given = {"through": {}, "smooth": False, "blend": 0.0, "axes": np.tile(DOWN, (len(points), 1)), "headings": None}
    return SeamShape(np.array(points, float), **(given | keys))


def samples(curve, count=3001):
    return np.linspace(0.0, curve.length, count)


CASES = {
    "exact": shape(),
    "rounded": shape(blend=0.02),
    "raster": shape([[0, 0, 0], [0.1, 0, 0], [0.1, 0.04, 0], [0, 0.04, 0], [0, 0.08, 0]], blend=0.03),
    "spline": shape(smooth=True),
    "woven": shape(smooth=True, weave=(0.003, 0.03)),
    "arc": shape([[0.1, 0, 0], [0.0, 0.1, 0]], through={1: np.array([0.1, 0.1, 0]) / np.sqrt(2)}),
    "turned": shape(smooth=True, axes=np.array([[0, 0, -1], [0, 0.6, -0.8], [0, 0, -1], [0.6, 0, -0.8]]), lead=0.2),
    "headed": shape(smooth=True, headings=np.array([[1.0, 0, 0], [0.8, 0.6, 0], [0, 1, 0], [0, 1, 0]])),
}


@pytest.mark.parametrize("name", CASES)
def test_a_curve_is_over_its_length(name):
    curve = CASES[name].curve()
    s = samples(curve)
    speed = np.linalg.norm(curve.points(s, 1), axis=1)
    assert np.abs(speed - 1.0).max() < 1e-4
    assert (np.diff(curve.breakpoints) > 0.0).all()


@pytest.mark.parametrize("name", CASES)
def test_bounds_hold_everywhere(name):
    curve = CASES[name].curve()
    s = samples(curve)
    k = curve.piece(s)
    assert (np.linalg.norm(curve.points(s, 2), axis=1) <= curve.bends[k] * (1 + 1e-9) + 1e-9).all()
    assert (np.linalg.norm(curve.points(s, 1), axis=1) <= curve.rates[k] * (1 + 1e-9)).all()
    h = 1e-6
    inner = s[(curve.piece(s + h) == k) & (s + h < curve.length)]
    R = [curve.rotations(inner), curve.rotations(inner + h)]
    if curve.heading is None:
        turned = np.linalg.norm(R[1][:, :, 2] - R[0][:, :, 2], axis=1)
    else:
        turned = np.linalg.norm((R[1] - R[0]).reshape(len(inner), 9), axis=1) / np.sqrt(2.0)
    assert (turned <= h * curve.turns[curve.piece(inner)] * (1 + 1e-3) + 1e-13).all()


def test_straight_parts_and_their_corners():
    curve = CASES["exact"].curve()
    way = np.linalg.norm(np.diff(SQUARE, axis=0), axis=1)
    assert curve.length == pytest.approx(way.sum())
    assert curve.corners == pytest.approx([0.3, 0.5])
    assert np.allclose(curve.points(np.array([0.0, 0.3, 0.5, curve.length])), SQUARE)
    assert curve.kinks.max(initial=0.0) < 1e-12


def test_a_rounded_corner_stays_near_it():
    curve = CASES["rounded"].curve()
    assert curve.corners == ()
    s = samples(curve, 20_001)
    p = curve.points(s)
    for corner in SQUARE[1:3]:
        beside = np.linalg.norm(p - corner, axis=1)
        assert 0.0 < beside.min() < 0.02
    straight = np.minimum(np.linalg.norm(p - SQUARE[1], axis=1), np.linalg.norm(p - SQUARE[2], axis=1)) > 0.02
    first = straight & (s < 0.25)
    assert np.abs(p[first][:, 1:]).max() < 1e-12
    assert curve.kinks.max(initial=0.0) < 1e-9


def test_an_arc_is_round():
    curve = CASES["arc"].curve()
    assert curve.length == pytest.approx(0.1 * np.pi / 2, abs=1e-9)
    assert np.abs(np.linalg.norm(curve.points(samples(curve)), axis=1) - 0.1).max() < 1e-9


def test_a_spline_is_that_of_its_points():
    """Every place of the curve is on the cubic spline over the chords, and it passes the points."""
    from scipy.interpolate import CubicSpline

    curve = CASES["spline"].curve()
    u = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(SQUARE, axis=0), axis=1))])
    dense = CubicSpline(u, SQUARE, bc_type="natural")(np.linspace(0.0, u[-1], 4001))
    for one in curve.points(samples(curve, 61)):
        k = min(max(int(np.linalg.norm(dense - one, axis=1).argmin()), 1), 3999)
        along = dense[k + 1] - dense[k - 1]
        assert np.linalg.norm(np.cross(one - dense[k], along)) / np.linalg.norm(along) < 1e-6
    assert min(np.linalg.norm(curve.points(samples(curve, 30_001)) - SQUARE[1], axis=1)) < 2e-5


@pytest.mark.parametrize("degrees", [60, 72, 75, 78, 81, 90])
def test_axes_of_a_spline_are_those_of_its_points_however_round_it_is(degrees):
    """Rounded corners have their axes in their middle; a span that turns as much has them at its ends."""
    angles = np.radians(degrees) * np.arange(8)
    points = np.stack([0.2 * np.cos(angles), 0.2 * np.sin(angles), 0.05 * angles], axis=1)
    axes = np.stack([0.4 * np.sin(angles), 0.4 * np.cos(3.0 * angles), np.full(8, -1.0)], axis=1)
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    one = shape(points, smooth=True, axes=axes)
    curve, given = one.curve(), knots_of(*one.elements(), len(points)).given
    assert np.abs(curve.points(given) - points).max() < 1e-9
    assert np.abs(curve.directions(given) - axes).max() < 1e-3


def test_lead_and_side_tilt_the_axis_by_their_angles():
    points = [[0.0, 0, 0], [0.3, 0, 0]]
    for keys, wanted in (
        ({"lead": 0.3}, [np.sin(0.3), 0, -np.cos(0.3)]),
        ({"side": 0.3}, [0, np.sin(0.3), -np.cos(0.3)]),
    ):
        z = shape(points, **keys).curve().directions(np.array([0.0, 0.1, 0.3]))
        assert np.allclose(z, wanted, atol=1e-9)


def test_a_woven_path_swings_by_its_amplitude():
    curve = shape([[0.0, 0, 0], [0.3, 0, 0]], weave=(0.004, 0.03)).curve()
    p = curve.points(samples(curve, 20_001))
    assert np.abs(p[:, 1]).max() == pytest.approx(0.004, rel=0.01)
    assert int((np.diff(np.sign(p[:, 1])) != 0).sum()) >= 19
    assert curve.length > 0.3


@pytest.mark.parametrize("turned", ["axis", "heading"])
def test_a_direction_that_may_vanish_has_no_bound(turned):
    """From -1 to 1 through nearly nothing: it turns by half a turn within a nanometre."""
    through = np.zeros((1, 4, 3))
    through[0, :2] = [[-1.0, 0.0, 1e-9], [2.0, 0.0, 0.0]]
    still = np.zeros((1, 4, 3))
    still[0, 0] = 0.0, 1.0, 0.0
    line = np.zeros((1, 6, 3))
    line[0, 1] = 1.0, 0.0, 0.0
    axes = {"axis": through, "heading": None} if turned == "axis" else {"axis": still, "heading": through}
    assert np.isinf(SeamCurve(np.array([0.0, 1.0]), line, **axes).turns).all()


def test_a_bound_of_a_long_piece_is_found_by_dividing_it():
    """Turning by 127 degrees in one piece: about its middle alone nothing could be told."""
    axis = np.zeros((1, 4, 3))
    axis[0, :2] = [[-1.0, 0.0, 0.5], [2.0, 0.0, 0.0]]
    line = np.zeros((1, 6, 3))
    line[0, 1] = 1.0, 0.0, 0.0
    (bound,) = SeamCurve(np.array([0.0, 1.0]), line, axis, None).turns
    assert 4.0 <= bound < 10.0
