"""Inverse dynamics of many states: those of pinocchio, state by state, on any thread."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pinocchio as pin
import pytest

import optiplan as op
from optiplan.robot.batched.dynamics import inverse_dynamics


@pytest.mark.parametrize("name", ["panda", "delbot", "srra"])
def test_torques_are_pinocchios_on_every_thread(name):
    robot, rng = op.load_robot(name), np.random.default_rng(0)
    states = rng.uniform(-1.0, 1.0, (3, 200, robot.n))
    data = robot.model.createData()
    expected = np.array([pin.rnea(robot.model, data, *state) for state in zip(*states, strict=True)])
    with ThreadPoolExecutor(4) as threads:
        found = list(threads.map(lambda _: inverse_dynamics(robot, *states), range(20)))
    assert all(np.allclose(tau, expected, rtol=1e-12, atol=1e-12) for tau in found)
    assert inverse_dynamics(robot, *states[:, :0]).shape == (0, robot.n)
