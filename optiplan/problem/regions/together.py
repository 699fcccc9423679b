"""Configurations that put several frames in their goals at once, and what samples any goal of poses."""

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.geometry.poses import pose_error
from optiplan.kinematics.ik.levenberg_marquardt import SeveralFrames
from optiplan.kinematics.ik.numeric import joints_that_move
from optiplan.problem.goals_and_vias import AllOfGoal, PoseGoal
from optiplan.problem.regions.region import RegionGoal
from optiplan.problem.regions.sampling import RegionSampler
from optiplan.robot.robot import Robot

_AIMED, _GOOD = 0.5, 0.8
"""Shares of the tolerances: where projection aims, and what it may use; the rest is for the error of planning."""

_ROUNDS, _ITERATIONS, _FIRST = 12, 6, 80


class TogetherSampler:
    """Projection onto the goals of several frames, by descents towards the poses in them nearest to the frames."""

    def __init__(self, robot: Robot, goal: AllOfGoal) -> None:
        self.goal = goal
        self._aimed = [part.inner(_AIMED) if isinstance(part, RegionGoal) else part for part in goal.parts]
        self._good = [part.inner(_GOOD) if isinstance(part, RegionGoal) else part for part in goal.parts]
        self._descent = SeveralFrames(robot, [(part.frame, _oriented(part)) for part in goal.parts])

    def contains(self, q: Array) -> bool:
        """Return whether q (n,) is in all goals, with room for the error of planning."""
        return all(_in(part, X, _GOOD) for part, X in zip(self._good, self._descent.places(q), strict=True))

    def miss(self, q: Array) -> tuple[float, float]:
        """Return by how much the frame that is farthest off is out of its goal at q (n,), m and rad."""
        misses = [_miss(part, X) for part, X in zip(self.goal.parts, self._descent.places(q), strict=True)]
        return max(misses, key=sum)

    def onto(self, q: Array) -> tuple[Array, bool]:
        """Return a configuration (n,) within limits near q (n,), and whether it is in all goals."""
        q = self._descent.inside(q)
        for _ in range(_ROUNDS):
            if self.contains(q):
                return q, True
            places = self._descent.places(q)
            self._descent.aim_all([_nearest(part, X) for part, X in zip(self._aimed, places, strict=True)])
            moved = self._descent.descend(q, _ITERATIONS)
            if np.array_equal(moved, q):
                break
            q = moved
        return q, self.contains(q)

    def drawn(self, seed: Array, rng: np.random.Generator) -> tuple[Array, bool]:
        """Return a configuration (n,) that reaches poses drawn from the goals, or any of them, and whether it does."""
        places = self._descent.places(seed)
        targets = [
            part.drawn(X, rng) if isinstance(part, RegionGoal) else part.X_WG
            for part, X in zip(self._aimed, places, strict=True)
        ]
        self._descent.aim_all(targets)
        return self.onto(self._descent.descend(seed, _FIRST))


def sampler_of(robot: Robot, goal: RegionGoal | AllOfGoal) -> RegionSampler | TogetherSampler:
    """Return what brings configurations into a goal."""
    return TogetherSampler(robot, goal) if isinstance(goal, AllOfGoal) else RegionSampler(robot, goal)


def joints_of(robot: Robot, goal: PoseGoal | RegionGoal | AllOfGoal) -> npt.NDArray[np.bool_]:
    """Return which joints (n,) move a frame of a goal."""
    parts = goal.parts if isinstance(goal, AllOfGoal) else (goal,)
    return np.asarray(np.any([joints_that_move(robot, part.frame) for part in parts], axis=0))


def _oriented(part: PoseGoal | RegionGoal) -> bool:
    if isinstance(part, PoseGoal):
        return part.orientation < np.pi
    return part.oriented or bool(part.X_RF.translation.any())


def _nearest(part: PoseGoal | RegionGoal, X_WF: pin.SE3) -> pin.SE3:
    return part.X_WG if isinstance(part, PoseGoal) else part.nearest(X_WF)


def _in(part: PoseGoal | RegionGoal, X_WF: pin.SE3, share: float) -> bool:
    if isinstance(part, RegionGoal):
        return part.contains(X_WF)
    position, angle = pose_error(X_WF, part.X_WG)
    return bool(position <= share * part.position and (angle <= share * part.orientation or not _oriented(part)))


def _miss(part: PoseGoal | RegionGoal, X_WF: pin.SE3) -> tuple[float, float]:
    if isinstance(part, RegionGoal):
        excess = part.excess(X_WF)
        return float(np.linalg.norm(excess[:3])), float(np.linalg.norm(excess[3:]))
    position, angle = pose_error(X_WF, part.X_WG)
    return float(position), float(angle) if _oriented(part) else 0.0
