"""Limits of polynomials, proved with their rounding: against exact arithmetic, and the attack that got through."""

import json
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from optiplan.geometry.scene import Scene
from optiplan.problem.problem import derived
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.continuous.polynomial_bounds import prove_bounds
from optiplan.verify.limit_checks import rate
from optiplan.verify.report import VerifyPolicy
from optiplan.verify.verify import verify
from tests.checks import named
from tests.verify.motions import problem_of, quintic

ATTACK = Path(__file__).parents[2] / "attacks" / "limits" / "trajectory.json"


@pytest.mark.parametrize("degree", [0, 1, 2, 4, 8, 15])
def test_bounds_a_billionth_wider_are_proved_and_narrower_ones_refused(degree):
    c = np.random.default_rng(degree).normal(size=(100, degree + 1))
    value = c @ np.linspace(0.0, 1.0, 200_001) ** np.arange(degree + 1)[:, None]
    low, high = value.min(axis=1), value.max(axis=1)
    assert prove_bounds(c, low - 1e-7, high + 1e-7).within.all()
    narrow = prove_bounds(c, low + 1e-9, high)
    assert not narrow.within.any()
    assert (narrow.beyond > 0.0).all()
    assert prove_bounds(c, np.full(100, -np.inf), np.full(100, np.inf)).within.all()


def test_terms_that_cancel_are_not_proved_whatever_they_come_to():
    """(x - 0.5)^24 scaled up: at most 6e4, but made of terms that add up to 2e16."""
    exact = [Fraction(1)]
    for _ in range(24):
        exact = [a - Fraction(1, 2) * b for a, b in zip([Fraction(0), *exact], [*exact, Fraction(0)], strict=True)]
    c = np.array([[float(x) for x in exact]]) * 1e12
    bound = np.array([1e12 * 0.5**24 + 1e-3])
    assert not prove_bounds(c, -bound, bound).within[0]
    assert prove_bounds(c, -bound - 1e4, bound + 1e4).within[0]


@pytest.mark.parametrize("seed", range(3))
def test_what_is_proved_holds_in_exact_arithmetic(seed):
    """Products of (x - a_i), multiplied out and scaled until rounding counts, against bounds near what is computed."""
    rng = np.random.default_rng(seed)
    rows = []
    for _ in range(20):
        degree = int(rng.integers(4, 26))
        rows.append(np.pad(np.poly(rng.uniform(-0.2, 1.2, degree))[::-1], (0, 25 - degree)))
    c = np.array(rows) * 10.0 ** rng.uniform(0, 6, (20, 1))
    x = np.linspace(0.0, 1.0, 65)
    value = np.abs(c @ x ** np.arange(26)[:, None]).max(axis=1)
    proofs = 0
    for slack in (1e-12, 1e-9, 1e-6, 1e-3, 1.0):
        bound = value * (1.0 + slack)
        for k in np.flatnonzero(prove_bounds(c, -bound, bound).within):
            proofs += 1
            exact = [Fraction(one) for one in c[k].tolist()]
            for i in range(0, 65, 8):
                assert abs(sum(one * Fraction(i, 64) ** p for p, one in enumerate(exact))) <= Fraction(bound[k])
    assert proofs


@pytest.mark.filterwarnings("ignore:invalid value", "ignore:overflow")
def test_numbers_that_overflow_are_never_proved():
    c = np.array([[0.0, np.inf, 0.0], [0.0, np.nan, 0.0], [0.0, 1e308, 1e308], [0.0, 1.0, 0.0]])
    assert prove_bounds(c, np.full(4, -2.0), np.full(4, 2.0)).within.tolist() == [False, False, False, True]


def jerk_at(coefficients, x):
    """Exactly: sum of k (k - 1) (k - 2) c_k x^(k-3)."""
    return sum(Fraction(c) * k * (k - 1) * (k - 2) * x ** (k - 3) for k, c in enumerate(coefficients) if k > 2)


def test_a_piece_of_degree_25_that_hides_its_jerk(planar):
    """A piece of 0.2 us whose jerk, in exact arithmetic, is 20 % above the limit, and within it in floating point."""
    motion = Trajectory.from_dict(json.loads(ATTACK.read_text()))
    limit = planar.limits.jerk[0]
    h = Fraction(motion.breakpoints[1])
    exact = max(abs(jerk_at(motion.coefficients[0, :, 0].tolist(), h * k / 1000)) for k in range(990, 1001))
    assert exact > 1.19 * Fraction(limit)
    report = verify(problem_of(planar, motion, Scene()), motion)
    assert not report.verified
    jerk = named(report, "jerk")
    assert not jerk.passed
    if jerk.worst <= limit:
        assert "piece 1, of degree 25 and 2.06e-07 s" in jerk.detail


def test_a_motion_at_its_limit_is_proved(planar):
    """A rounding within the limit, as timings leave it; and without any limit."""
    motion = quintic(planar.joint_names, [1.0, 0.0], [-1.0, 0.5], 1.0)
    problem = problem_of(planar, motion, Scene())
    for order, name in ((1, "velocity"), (2, "acceleration"), (3, "jerk")):
        peak = np.abs(np.stack(motion.extrema(order))).max(axis=0)
        at = derived(problem, limits=replace(problem.limits, **{name: peak}))
        assert rate(at, motion, VerifyPolicy(), order).passed
        none = derived(problem, limits=replace(problem.limits, **{name: np.full(2, np.inf)}))
        assert rate(none, motion, VerifyPolicy(), order).passed
