"""What a motion does, along it: joints up to the jerk, torques, the tool's pose and speed."""

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.kinematics.manipulability import ToolKinematics
from optiplan.problem.problem import Problem
from optiplan.problem.task.timeline import ScenePart, mismatch, scene_parts
from optiplan.trajectory.trajectory import Extrema, Trajectory

LEAST = 600
"""Samples of a motion, at the least; drawn curves show no corners then."""
LEAST_IN_PIECE = 4
"""Samples of a polynomial piece, at the least, both ends included."""

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
    """

    t: Array
    joints: tuple[Array, ...]
    torque: Array
    X_WT: Array
    speed: Array
    turning: Array
    extrema: tuple[Extrema, ...]


def motion_curves(problem: Problem, trajectory: Trajectory, least: int = LEAST) -> MotionCurves:
    """Sample a motion of a problem's robot at `least` times or more, evenly within every polynomial piece."""
    robot = problem.robot
    t, states = piecewise_states(trajectory, least)
    q, v, a, _ = states
    X_WT, J = ToolKinematics(robot).evaluate(q)
    twist = np.einsum("kij,kj->ki", J, v)
    torque = _torques(problem, trajectory, t, (q, v, a))
    speed, turning = (np.linalg.norm(part, axis=1) for part in (twist[:, :3], twist[:, 3:]))
    extrema = tuple(trajectory.extrema_at(order) for order in range(4))
    return MotionCurves(t, states, torque, X_WT, speed, turning, extrema)


def _torques(problem: Problem, trajectory: Trajectory, t: Array, states: tuple[Array, Array, Array]) -> Array:
    """Torques (k, n) at times t (k,); of a task with the load of each part."""
    whole = not problem.task or mismatch(problem, trajectory)
    parts = [ScenePart(problem, 0.0, trajectory.duration)] if whole else scene_parts(problem, trajectory)
    which = np.searchsorted([part.end for part in parts[:-1]], t)
    models = [part.problem.robot.model for part in parts]
    data = [model.createData() for model in models]
    rows = zip(which, *states, strict=True)
    return np.array([pin.rnea(models[k], data[k], *state).copy() for k, *state in rows])


def piecewise_states(trajectory: Trajectory, least: int = LEAST) -> tuple[Array, tuple[Array, ...]]:
    """Times (k,), s, and positions to jerks (k, n) at them, with both ends of every piece evaluated in that piece."""
    widths = np.diff(trajectory.breakpoints)
    counts = np.maximum(LEAST_IN_PIECE, np.ceil(least * widths / trajectory.duration).astype(int) + 1)
    piece = np.repeat(np.arange(len(widths)), counts)
    local = np.concatenate([np.linspace(0.0, h, count) for h, count in zip(widths, counts, strict=True)])
    states = []
    for order in range(4):
        c = trajectory.derivatives(order)[piece]  # (k, d + 1, n)
        value = c[:, -1]
        for power in range(c.shape[1] - 2, -1, -1):
            value = value * local[:, None] + c[:, power]
        states.append(value)
    return trajectory.breakpoints[piece] + local, tuple(states)
