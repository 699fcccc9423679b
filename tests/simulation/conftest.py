"""Robots and short motions that the tests of closed loops share."""

import numpy as np
import pytest

from optiplan.problem.load import problem_from_dict
from optiplan.robot.robot import load_robot
from optiplan.trajectory.paths.hermite import hermite
from optiplan.trajectory.trajectory import Trajectory

READY = (0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785)


@pytest.fixture(scope="session")
def panda():
    return load_robot("panda")


@pytest.fixture(scope="session")
def ur5():
    return load_robot("ur5")


@pytest.fixture(scope="session")
def planar():
    return load_robot("planar2r")


@pytest.fixture(scope="session")
def reach():
    """The Panda at `ready`, in an empty scene."""
    return problem_from_dict({"version": 1, "robot": "panda", "start": {"joints": READY}, "goal": {"joints": READY}})


def swing(names, start, by, duration):
    """A quintic from rest to rest."""
    start, end = np.array(start, float), np.array(start, float) + by
    still = np.zeros_like(start)
    tau = hermite(np.array([start, still, still]), np.array([end, still, still]), np.array([duration]))
    powers = duration ** np.arange(tau.shape[1])
    return Trajectory(tuple(names), np.array([0.0, duration]), tau / powers[None, :, None])
