"""What carries the targets of a tour: the world, or a part of the robot with its own joints, such as a positioner."""

from collections.abc import Sequence
from itertools import product

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.problem.problem import Problem, derived
from optiplan.problem.regions.region import RegionGoal
from optiplan.problem.task.scene_change import standing
from optiplan.robot.frames import frame_poses, moving_joints

_POSITIONS = (12, 36)
"""Positions of a carrier with one joint and with more, at which configurations are looked for at first."""

_OFFSETS = (-4, -2, -1, 1, 2, 4)
"""Steps of each joint of a carrier, to look for configurations near a chosen one."""


class Carrier:
    """The link of a robot that carries targets, at positions U (k, c), rad or m, of the c joints that move it.

    Attributes:
        own: places of its joints in a configuration of the robot.
        others: places of the joints of the arm.
        problem: of the arm alone, with the carrier where it is at the start.
    """

    def __init__(self, problem: Problem, link: str) -> None:
        names = problem.robot.joint_names
        carrying = set(moving_joints(problem.robot, link)) if link else set()
        self.link, self.robot, self.start, self.limits = link, problem.robot, problem.start, problem.limits
        self.own = [k for k, name in enumerate(names) if name in carrying]
        self.others = [k for k, name in enumerate(names) if name not in carrying]
        self.problem = problem if not self.own else self._alone(problem, [names[k] for k in self.others])

    def _alone(self, problem: Problem, joints: Sequence[str]) -> Problem:
        kept = self.others
        return derived(
            problem,
            robot=standing(problem.robot, joints, problem.start),
            scene=problem.scene.ending_at(problem.start[kept]),
            start=problem.start[kept],
            start_velocity=np.zeros(len(kept)),
            start_acceleration=np.zeros(len(kept)),
            limits=problem.limits.of_joints(kept),
            tracking_error=problem.tracking_error[kept],
        )

    def positions(self) -> Array:
        """Return positions (k, c) all over the range: its own at the start, and others within a turn of it."""
        if not self.own:
            return np.zeros((1, 0))
        each = round(_POSITIONS[len(self.own) > 1] ** (1.0 / len(self.own)))
        axes = []
        for k in self.own:
            half = np.pi if self.robot.revolute[k] else np.inf
            low = max(self.limits.lower[k], self.start[k] - half)
            high = min(self.limits.upper[k], self.start[k] + half)
            axes.append(np.linspace(low, high, each))
        return np.concatenate([self.start[None, self.own], np.array(list(product(*axes)))])

    def near(self, U: Array, step: float) -> Array:
        """Return positions (m, k, c) within limits about each of U (m, c), each joint moved by itself."""
        moves = [np.zeros(len(self.own))]
        moves += [step * by * axis for axis in np.eye(len(self.own)) for by in _OFFSETS]
        found = U[:, None] + np.array(moves)
        return np.clip(found, self.limits.lower[self.own], self.limits.upper[self.own])

    def poses(self, U: Array) -> Array:
        """Return X_WC (..., 4, 4) at positions U (..., c)."""
        if not self.own:
            return np.broadcast_to(np.eye(4), (*U.shape[:-1], 4, 4))
        Q = np.broadcast_to(self.start, (*U.shape[:-1], self.robot.n)).copy()
        Q[..., self.own] = U
        return frame_poses(self.robot, Q.reshape(-1, self.robot.n), self.link).reshape(*U.shape[:-1], 4, 4)

    def placed(self, goal: RegionGoal, u: Array) -> RegionGoal:
        """Return a target at position u (c,) as a region in the world."""
        return goal.moved(pin.SE3(self.poses(u))) if self.own else goal

    def whole(self, Q: Array, U: Array) -> Array:
        """Return configurations (..., n) of the robot, of those of the arm and of the carrier."""
        if not self.own:
            return Q
        found = np.empty((*Q.shape[:-1], self.robot.n))
        found[..., self.others], found[..., self.own] = Q, U
        return found
