"""Helpers on arrays."""

import numpy as np

from optiplan.arrays import cross, distinct


def test_distinct_is_what_unique_returns():
    rng = np.random.default_rng(0)
    for values in (rng.integers(0, 9, (20, 2)), rng.integers(0, 5, 12) / 4.0, np.zeros(3), np.zeros((0, 2)), [2, 1, 2]):
        assert distinct(np.asarray(values)).tolist() == np.unique(values).tolist()
        assert distinct(np.asarray(values)).dtype == np.asarray(values).dtype


def test_cross_is_that_of_numpy_whatever_the_shapes() -> None:
    rng = np.random.default_rng(0)
    for shapes in (((3,), (3,)), ((4, 3), (3,)), ((2, 1, 3), (5, 3))):
        a, b = (rng.normal(size=shape) for shape in shapes)
        np.testing.assert_allclose(cross(a, b), np.cross(a, b), rtol=1e-15, atol=1e-15)
