"""What a motion does, along it: joints up to the jerk, torques, the tool's pose and speed."""

import numpy as np

from optiplan.arrays import Array
from optiplan.kinematics.manipulability import ToolKinematics
from optiplan.problem.problem import Problem
from optiplan.problem.task.scene_part import ScenePart
from optiplan.problem.task.timeline import mismatch, scene_parts
from optiplan.records import dataclass
from optiplan.robot.batched.dynamics import inverse_dynamics
from optiplan.trajectory.trajectory import Extrema, Trajectory
from optiplan.viewer.plots.refined_extrema import PieceSamples, refined_extrema

LEAST = 600
"""Samples of a motion, at the least; drawn curves show no corners then."""


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
    drives = Drives(problem, trajectory)
    torque = drives.torques(samples)
    speed, turning = (np.linalg.norm(part, axis=1) for part in (twist[:, :3], twist[:, 3:]))
    extrema = tuple(trajectory.extrema_at(order) for order in range(4))
    peaks = refined_extrema(samples, torque, drives.torques)
    return MotionCurves(t, states, torque, X_WT, speed, turning, extrema, peaks)


class Drives:
    """Torques of the joints' drives by inverse dynamics; in a task with the load of each part."""

    def __init__(self, problem: Problem, trajectory: Trajectory) -> None:
        whole = not problem.task or mismatch(problem, trajectory)
        parts = [ScenePart(problem, 0.0, trajectory.duration)] if whole else scene_parts(problem, trajectory)
        self._ends = [part.end for part in parts[:-1]]
        self._robots = [part.problem.robot for part in parts]

    def torques(self, samples: PieceSamples) -> Array:
        """(k, n), N m or N, at k times."""
        breaks = samples.trajectory.breakpoints
        which = np.searchsorted(self._ends, 0.5 * (breaks[samples.piece] + breaks[samples.piece + 1]))
        states = np.stack(samples.states()[:3])
        tau = np.empty(states.shape[1:])
        for k, robot in enumerate(self._robots):
            tau[which == k] = inverse_dynamics(robot, *states[:, which == k])
        return tau
