"""One problem of the front door's tests, and one run of it."""

import pytest

import optiplan as op


@pytest.fixture(scope="session")
def planar():
    return op.load_robot("planar2r")


@pytest.fixture(scope="session")
def problem(planar):
    wall = op.Box("wall", size=(0.1, 0.1, 0.1), position=(1.0, 1.3, 0.0))
    return op.Problem(planar, start="ready", goal=[0.4, 0.9], scene=[wall], name="turn")


@pytest.fixture(scope="session")
def run(problem):
    return op.plan(problem, "quintic")
