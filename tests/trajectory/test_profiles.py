"""Time laws: from 0 to 1 at rest, within their bounds, and no slower than need be."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from optiplan.trajectory.profiles.laws import CUBIC, QUINTIC, SEPTIC, BangBang, Bounds, Law, SCurve, Trapezoid
from optiplan.trajectory.timing.lower_bound import lower_bound
from optiplan.trajectory.trajectory import Trajectory
from tests.trajectory.test_timing import limits_of

LAWS = {"cubic": CUBIC, "quintic": QUINTIC, "septic": SEPTIC, "lspb": Trapezoid(), "bangbang": BangBang()}
LAWS |= {"scurve": SCurve()}
SIZES = st.floats(-2.0, 2.0).map(lambda x: 10.0**x)
BOUNDS = st.builds(Bounds, SIZES, SIZES, SIZES)


def as_motion(law: Law, duration: float, bounds: Bounds) -> Trajectory:
    made = law.pieces(duration, bounds)
    return Trajectory(("s",), made.breakpoints, made.coefficients[:, :, None])


def shares(motion: Trajectory, bounds: Bounds) -> list[float]:
    """Of the bounds on velocity, acceleration and jerk that the motion takes."""
    sizes = (bounds.velocity, bounds.acceleration, bounds.jerk)
    return [float(np.abs(motion.extrema(order)).max() / size) for order, size in enumerate(sizes, 1)]


def kept(name: str, motion: Trajectory, bounds: Bounds) -> float:
    """The largest share of the bounds that a law can meet."""
    return max(shares(motion, bounds)[: 2 if name in ("lspb", "bangbang") else 3])


@pytest.mark.parametrize("name", sorted(LAWS))
@settings(max_examples=25, deadline=None)
@given(bounds=BOUNDS, longer=st.floats(1.0, 50.0))
def test_from_rest_to_rest_within_bounds(name, bounds, longer):
    law = LAWS[name]
    for T in (law.shortest(bounds), longer * law.shortest(bounds)):
        motion = as_motion(law, T, bounds)
        assert motion.duration == pytest.approx(T, rel=1e-12)
        assert motion.start == 0.0
        assert motion.end == pytest.approx(1.0, abs=1e-12)
        assert np.abs(motion(np.array([0.0, motion.duration]), 1)).max() * T < 1e-10
        assert np.abs(motion.jumps(0)).max(initial=0.0) < 1e-12
        assert np.abs(motion.jumps(1)).max(initial=0.0) * T < 1e-10
        assert kept(name, motion, bounds) <= 1.0 + 1e-8
        middle = motion(0.5 * T * np.array([0.6, 1.0, 1.4]))[:, 0]
        assert middle[1] == pytest.approx(0.5, abs=1e-10)
        assert middle[0] + middle[2] == pytest.approx(1.0, abs=1e-10)


@pytest.mark.parametrize("name", sorted(LAWS))
@settings(max_examples=25, deadline=None)
@given(bounds=BOUNDS)
def test_shortest_is_shortest(name, bounds):
    """One of the bounds is met exactly, and a duration 1 % shorter breaks one."""
    law = LAWS[name]
    T = law.shortest(bounds)
    assert kept(name, as_motion(law, T, bounds), bounds) == pytest.approx(1.0, rel=1e-8)
    assert kept(name, as_motion(law, 0.99 * T, bounds), bounds) > 1.0


@settings(max_examples=50, deadline=None)
@given(bounds=BOUNDS, distance=SIZES)
def test_scurve_takes_the_lower_bound(bounds, distance):
    limits = limits_of(*([size * distance] for size in (bounds.velocity, bounds.acceleration, bounds.jerk)))
    bound = lower_bound(np.zeros(1), np.array([distance]), limits)
    assert SCurve().shortest(bounds) == pytest.approx(bound, rel=1e-9)


def test_scurve_without_a_jerk_bound_is_bang_bang():
    bounds = Bounds(3.0, 2.0)
    t = np.linspace(0.0, SCurve().shortest(bounds), 100)
    one, other = (as_motion(law, float(t[-1]), bounds)(t) for law in (SCurve(), BangBang()))
    assert one == pytest.approx(other, abs=1e-12)
    assert t[-1] == pytest.approx(BangBang().shortest(bounds), rel=1e-12)


def test_bangbang_switches_in_the_middle_unless_the_velocity_bound_comes_between():
    free, bounded = (BangBang().pieces(BangBang().shortest(b), b) for b in (Bounds(9.0, 4.0), Bounds(0.5, 4.0)))
    assert free.breakpoints == pytest.approx([0.0, 0.5, 1.0])  # t_s = sqrt(1 / 4)
    assert 2.0 * free.coefficients[0, 2] == pytest.approx(4.0)
    assert bounded.breakpoints == pytest.approx([0.0, 0.125, 2.0, 2.125])  # 1 / v + v / a
    assert bounded.coefficients[1, 1] == pytest.approx(0.5)
    slow = BangBang().pieces(3.0, Bounds(9.0, 4.0))
    assert 2.0 * slow.coefficients[0, 2] == pytest.approx(4.0 / 9.0)


def test_peaks_of_the_polynomials():
    assert CUBIC.peaks() == pytest.approx((1.5, 6.0, 12.0), rel=1e-12)
    assert QUINTIC.peaks() == pytest.approx((1.875, 10.0 / np.sqrt(3.0), 60.0), rel=1e-12)
    assert SEPTIC.peaks()[0] == pytest.approx(2.1875, rel=1e-12)


@pytest.mark.parametrize("law", [Trapezoid(velocity=0.8), Trapezoid(blend_time=0.3), Trapezoid(acceleration=2.5)])
def test_a_trapezoid_has_what_it_is_asked_for_in_its_shortest_time(law):
    bounds = Bounds(2.0, 3.0)
    T = law.shortest(bounds)
    motion = as_motion(law, T, bounds)
    V, b, a = np.abs(motion.extrema(1)).max(), law.blend(T, bounds), np.abs(motion.extrema(2)).max()
    assert (1.0 / (T - b), V / b) == pytest.approx((V, a))
    asked = {"velocity": V, "blend_time": b, "acceleration": a}
    for name, value in asked.items():
        if getattr(law, name) is not None:
            assert getattr(law, name) == pytest.approx(value)
    assert max(V / bounds.velocity, a / bounds.acceleration) <= 1.0 + 1e-9


def test_blends_of_a_third_bend_only_to_the_bounds():
    """A third of the time where it is allowed; else as near to it as velocity and acceleration let it be."""
    law = Trapezoid()
    assert law.blend(3.0, Bounds(9.0, 9.0)) == pytest.approx(1.0)
    assert law.blend(3.0, Bounds(0.4, 9.0)) == pytest.approx(3.0 - 1.0 / 0.4)
    b = law.blend(3.0, Bounds(9.0, 0.48))
    assert 1.0 / (3.0 - b) / b == pytest.approx(0.48)
    assert b > 1.0
