"""Robots and short motions that the tests of closed loops share."""

import numpy as np
import pytest
from ruamel.yaml import YAML

import optiplan as op
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


FETCH = """
version: 1
robot: panda
start: {joints: [0.2, 0.3, 0, -2.35, 0, 2.65, 0.98, 0.03]}
scene:
  obstacles:
    - {name: table, shape: {box: [0.7, 1.2, 0.04]}, pose: {position: [0.5, 0, -0.02]}}
    - {name: cube, shape: {box: [0.045, 0.045, 0.045]}, pose: {position: [0.45, 0.1, 0.0235]}}
task:
  - approach: {pose: {position: [0.45, 0.1, 0.025], rpy: [3.14159265, 0, 0]}, distance: 0.04}
  - attach: {object: cube, link: panda_hand, touch: [panda_leftfinger, panda_rightfinger], mass: 0.1}
  - gripper: {group: hand, joints: [0.0225]}
  - retreat: {distance: 0.04}
  - approach: {pose: {position: [0.45, 0.05, 0.0255], rpy: [3.14159265, 0, 0]}, distance: 0.04}
  - gripper: {group: hand, joints: [0.03]}
  - detach: {object: cube}
  - retreat: {distance: 0.04}
"""


@pytest.fixture(scope="session")
def fetch():
    """A verified run: the Panda takes a cube from a table and puts it down 5 cm farther."""
    run = op.plan(problem_from_dict(YAML(typ="safe").load(FETCH)), budget=20.0)  # the quicker, the shorter to execute
    assert run.verified, run
    return run
