"""Polynomials: which can hold an extremum, and roots of rising ones."""

import numpy as np

from optiplan.trajectory import polynomial


def test_what_is_passed_over_holds_no_extremum():
    c = np.random.default_rng(5).normal(size=(60, 4, 9)) * np.linspace(0.1, 1.0, 60)[:, None, None]
    asked = polynomial.may_hold_extrema(c)
    assert 0 < asked.sum() < 0.5 * asked.size
    value = polynomial.evaluate(c[:, :, None, :], np.linspace(0.0, 1.0, 500))
    low, high = value.min(axis=2), value.max(axis=2)
    assert asked[low.argmin(axis=0), np.arange(4)].all()
    assert asked[high.argmax(axis=0), np.arange(4)].all()


def test_rising_root_is_the_root():
    c = np.array([[-0.3, 1.0, 0.0, 0.0], [-1e-9, 0.0, 0.0, 1.0], [-0.999, 0.0, 0.5, 0.5]])
    root = polynomial.rising_root(c)
    assert np.abs(polynomial.evaluate(c, root)).max() < 1e-15
    assert ((root > 0.0) & (root < 1.0)).all()
    assert polynomial.rising_root(np.zeros((0, 4))).shape == (0,)
