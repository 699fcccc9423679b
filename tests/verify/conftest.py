"""Robots of the verifier's tests."""

import pytest

from optiplan.robot.robot import load_robot


@pytest.fixture(scope="session")
def planar():
    return load_robot("planar2r")


@pytest.fixture(scope="session")
def panda():
    return load_robot("panda")
