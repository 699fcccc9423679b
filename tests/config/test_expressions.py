"""Expressions of numbers: arithmetic, and nothing else."""

import pytest

from optiplan.config.expressions import NO_ARITHMETIC, arithmetic


def test_arithmetic():
    assert arithmetic("2 * (a + 1) / 4 - sqrt(4) % 3", {"a": 3}) == 0.0
    assert arithmetic("-cos(pi)", {}) == 1.0


@pytest.mark.parametrize("text", ["", "a b", "__import__('os')", "(1).real", "[1]", "True", "1 / 0", "'a'"])
def test_what_is_no_arithmetic_is_refused(text):
    with pytest.raises((*NO_ARITHMETIC, KeyError)):
        arithmetic(text, {})
