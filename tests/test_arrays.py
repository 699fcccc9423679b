"""Helpers on arrays."""

import numpy as np

from optiplan.arrays import distinct


def test_distinct_is_what_unique_returns():
    rng = np.random.default_rng(0)
    for values in (rng.integers(0, 9, (20, 2)), rng.integers(0, 5, 12) / 4.0, np.zeros(3), np.zeros((0, 2)), [2, 1, 2]):
        assert distinct(np.asarray(values)).tolist() == np.unique(values).tolist()
        assert distinct(np.asarray(values)).dtype == np.asarray(values).dtype
