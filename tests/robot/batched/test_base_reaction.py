"""The reaction at the base: Pinocchio's recursion, the weight at rest, and the rate of the momentum."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

import optiplan as op
from optiplan.robot.batched.base_reaction import base_reaction


def by_recursion(robot, q, v, a):
    """The forces that the joints on the base transmit, and the weight of the base."""
    model, data = robot.model, robot.model.createData()
    pin.forwardKinematics(model, data, q)
    pin.rnea(model, data, q, v, a)
    total = pin.Force.Zero()
    for j in range(1, model.njoints):
        if model.parents[j] == 0:
            total += data.oMi[j].act(data.f[j])
    weight = -model.inertias[0].mass * model.gravity.linear
    return total.vector + np.concatenate([weight, np.cross(model.inertias[0].lever, weight)])


def standing(name):
    """A robot on a turned base with a payload, under a gravity of its own."""
    robot = op.load_robot(name)
    X_WB = pin.SE3(pin.rpy.rpyToMatrix(0.1, -0.2, 0.7), np.array([0.3, -1.0, 0.5]))
    link = next(f.name for f in reversed(robot.model.frames.tolist()) if f.type == pin.FrameType.BODY)
    load = ((str(link), pin.Inertia(1.5, np.array([0.1, 0.0, 0.2]), np.diag([0.01, 0.02, 0.025]))),)
    return robot.mounted(replace(robot.mounting, X_WB=X_WB, gravity=np.array([0.5, 0.0, -9.0]), payload=load))


@pytest.mark.parametrize("name", ["srra", "delbot", "panda", "baxter"])
def test_the_wrench_is_that_of_pinocchios_recursion(name):
    rng = np.random.default_rng(0)
    for robot in (op.load_robot(name), standing(name)):
        states = rng.uniform(-1.0, 1.0, (3, 20, robot.n))
        expected = np.array([by_recursion(robot, *state) for state in zip(*states, strict=True)])
        assert np.allclose(base_reaction(robot, *states), expected, rtol=1e-10, atol=1e-9)


def test_at_rest_the_ground_carries_the_weight_below_the_centre_of_mass():
    robot = standing("srra")
    Q = np.random.default_rng(1).uniform(-3.0, 3.0, (5, robot.n))
    wrench = base_reaction(robot, Q, 0.0 * Q, 0.0 * Q)
    mass = sum(body.mass for body in robot.model.inertias)
    assert np.allclose(wrench[:, :3], -mass * robot.mounting.gravity)
    data = robot.model.createData()
    centres = np.array([pin.centerOfMass(robot.model, data, q) for q in Q])
    assert np.allclose(wrench[:, 3:], np.cross(centres, wrench[:, :3]))


def test_the_wrench_is_the_rate_of_the_momentum():
    """Of a motion q(t) = q0 + sin(w t): the change of the momentum about the world's origin, by differences."""
    robot, rng, h = op.load_robot("delbot"), np.random.default_rng(2), 1e-5
    q0, w = rng.uniform(-1.0, 1.0, (2, robot.n))
    data = robot.model.createData()

    def momentum(t):
        pin.computeCentroidalMomentum(robot.model, data, q0 + np.sin(w * t), w * np.cos(w * t))
        return pin.SE3(np.eye(3), pin.centerOfMass(robot.model, data, q0 + np.sin(w * t))).act(data.hg).vector

    t = 0.3
    Q, V, A = q0 + np.sin(w * t), w * np.cos(w * t), -(w**2) * np.sin(w * t)
    rate = (momentum(t + h) - momentum(t - h)) / (2.0 * h)
    moving = base_reaction(robot, Q[None], V[None], A[None]) - base_reaction(robot, Q[None], 0 * V[None], 0 * A[None])
    assert np.allclose(moving[0], rate, atol=1e-6)
