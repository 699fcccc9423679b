"""Sets of configurations in one alternative of a goal, linearised: for steps that stay in them."""

from dataclasses import dataclass
from itertools import product

import numpy as np

from optiplan.arrays import Array
from optiplan.kinematics.ik.levenberg_marquardt import Descent
from optiplan.problem.problem import PoseGoal, RegionGoal
from optiplan.problem.regions.sampling import RegionSampler
from optiplan.robot.robot import Robot

_SHARE = 0.9  # share of the tolerance used; the rest is for the error of the planned end
_FINE = 1e-3  # m and rad: smaller tolerances are met exactly, since the program's own accuracy is of that size
_NORMALS = np.array([v for v in product((-1.0, 0.0, 1.0), repeat=3) if any(v)])
_NORMALS /= np.linalg.norm(_NORMALS, axis=1, keepdims=True)
_INNER = 0.87  # share of a radius: the polytope of these 26 half-spaces then lies within the ball, nearly


@dataclass(frozen=True, eq=False)
class StepRows:
    """Equalities A d = b and inequalities G d <= h that a step d (n,) of the joints keeps."""

    A: Array
    b: Array
    G: Array
    h: Array


class PoseSet:
    """Configurations in a pose goal: |e_p - J_p d| <= rho_p, |e_R - J_R d| <= rho_R, the balls as polytopes.

    Attributes:
        point: whether a step that stays in it has no freedom to speak of.
    """

    def __init__(self, robot: Robot, goal: PoseGoal) -> None:
        oriented = goal.orientation < np.pi
        self._descent = Descent(robot, goal.frame, oriented)
        self._descent.aim(goal.X_WG)
        self._radii = _SHARE * goal.position, _SHARE * goal.orientation
        rows = 6 if oriented else 3
        self.point = robot.n <= rows and max(goal.position, goal.orientation if oriented else 0.0) <= _FINE

    def contains(self, q: Array) -> bool:
        """Return whether q (n,) is within the tolerance."""
        e, _ = self._descent.error(q)
        return bool(np.linalg.norm(e[:3]) <= self._radii[0] and np.linalg.norm(e[3:]) <= self._radii[1])

    def settle(self, q: Array) -> Array | None:
        """Return a configuration (n,) near q within limits and the tolerance; None if that is not found."""
        return self._descent.settle(self._descent.inside(q), *self._radii)

    def rows(self, q: Array) -> StepRows:
        """Return what keeps a step from q (n,) in the set, to first order."""
        e, J = self._descent.error(q)
        n = len(q)
        equal, value, rows, upper = [np.zeros((0, n))], [np.zeros(0)], [np.zeros((0, n))], [np.zeros(0)]
        for part, rho in zip((slice(0, 3), slice(3, 6)), self._radii, strict=True):
            if rho <= _FINE:
                equal.append(J[part])
                value.append(e[part])
            elif len(J[part]):
                rows.append(-_NORMALS @ J[part])
                upper.append(np.maximum(_INNER * rho - _NORMALS @ e[part], 0.0))
        return StepRows(np.vstack(equal), np.concatenate(value), np.vstack(rows), np.concatenate(upper))


class RegionSet:
    """Configurations in a region: low <= c + A J d <= high of its coordinates c.

    Attributes:
        point: whether a step that stays in it has no freedom to speak of.
    """

    def __init__(self, robot: Robot, goal: RegionGoal) -> None:
        self._sampler, self._descent = RegionSampler(robot, goal), Descent(robot, goal.frame)
        self._goal = goal.inner(_SHARE)
        self._fine = goal.high - goal.low <= 2.0 * _FINE
        self.point = robot.n <= 6 and bool(self._fine.all())

    def contains(self, q: Array) -> bool:
        """Return whether q (n,) is in the region."""
        return self._sampler.contains(q)

    def settle(self, q: Array) -> Array | None:
        """Return a configuration (n,) near q within limits and the region; None if that is not found."""
        found, inside = self._sampler.onto(q)
        return found if inside else None

    def rows(self, q: Array) -> StepRows:
        """Return what keeps a step from q (n,) in the set, to first order."""
        X_WF, goal = self._descent.place(q).copy(), self._goal
        c, J = goal.coordinates(X_WF), goal.rates(X_WF) @ self._descent.jacobian(q)
        middle = 0.5 * (goal.low[self._fine] + goal.high[self._fine])
        below, above = np.isfinite(goal.low) & ~self._fine, np.isfinite(goal.high) & ~self._fine
        G = np.vstack([-J[below], J[above]])
        h = np.concatenate([(c - goal.low)[below], (goal.high - c)[above]])
        return StepRows(J[self._fine], middle - c[self._fine], G, np.maximum(h, 0.0))


def goal_set(robot: Robot, goal: PoseGoal | RegionGoal) -> PoseSet | RegionSet:
    """Return the set of configurations in a goal that is no configuration."""
    return PoseSet(robot, goal) if isinstance(goal, PoseGoal) else RegionSet(robot, goal)
