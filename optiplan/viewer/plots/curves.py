"""What a motion does, along it: joints up to the jerk, torques, the tool's pose and speed."""

from dataclasses import dataclass
from functools import partial

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.kinematics.manipulability import ToolKinematics
from optiplan.problem.problem import Problem
from optiplan.trajectory.trajectory import Extrema, Trajectory
from optiplan.viewer.plots.refined_extrema import PieceSamples, States, refined_extrema

LEAST = 600
"""Samples of a motion, at the least; drawn curves show no corners then."""

ORDERS = ("position", "velocity", "acceleration", "jerk")
"""Quantities of a joint by the order of the derivative."""


@dataclass(frozen=True, eq=False)
class MotionCurves:
    """Samples along one motion of n joints; T is the tool frame, W the world.

    A breakpoint comes twice, as the end of one piece and the beginning of the next, so a jump is seen as a jump.

    Attributes:
        t: (k,) not falling, s; the first is 0, the last the duration.
        joints: of each order 0 to 3 an array (k, n), rad/s^order or m/s^order; of the pieces themselves, exact.
        torque: (k, n), N m or N, of the joints' drives by inverse dynamics.
        X_WT: (k, 4, 4), m.
        speed: (k,) |v_WT|, m/s.
        turning: (k,) |w_WT|, rad/s.
        extrema: of each order 0 to 3 the exact minima and maxima over all time.
        torque_extrema: those of the torque, refined between the samples (`refined_extrema`).
    """

    t: Array
    joints: tuple[Array, ...]
    torque: Array
    X_WT: Array
    speed: Array
    turning: Array
    extrema: tuple[Extrema, ...]
    torque_extrema: Extrema


def motion_curves(problem: Problem, trajectory: Trajectory, least: int = LEAST) -> MotionCurves:
    """Sample a motion of a problem's robot at `least` times or more, evenly within every polynomial piece."""
    robot = problem.robot
    samples = PieceSamples.of(trajectory, least)
    t, states = samples.t, samples.states()
    X_WT, J = ToolKinematics(robot).evaluate(states[0])
    twist = np.einsum("kij,kj->ki", J, states[1])
    torque = torques_at(problem, states)
    speed, turning = (np.linalg.norm(part, axis=1) for part in (twist[:, :3], twist[:, 3:]))
    extrema = tuple(trajectory.extrema_at(order) for order in range(4))
    peaks = refined_extrema(samples, torque, partial(torques_at, problem))
    return MotionCurves(t, states, torque, X_WT, speed, turning, extrema, peaks)


def torques_at(problem: Problem, states: States) -> Array:
    """Torques of the joints' drives by inverse dynamics, (k, n), N m or N, at states of k times."""
    robot, data = problem.robot, problem.robot.model.createData()
    return np.array([pin.rnea(robot.model, data, *state).copy() for state in zip(*states[:3], strict=True)])
