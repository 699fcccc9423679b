"""Verified runs to execute, planned once."""

from collections.abc import Callable
from functools import cache

import pytest

import optiplan as op


@cache
def planned(name: str) -> op.Run:
    problem = op.load_problem(name)
    run = op.plan(problem, budget=20.0 if problem.task else 3.0)
    assert run.verified, run
    return run


@pytest.fixture(scope="session")
def run_of() -> Callable[[str], op.Run]:
    """Return the verified run of a shipped problem."""
    return planned
