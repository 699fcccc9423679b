"""Walk along the constraints from one configuration towards another."""

import numpy as np

from optiplan.arrays import Array
from optiplan.planners.base import Budget
from optiplan.planners.sampling.constrained.manifold import Manifold
from optiplan.planners.sampling.edge_checker import MotionCheck
from optiplan.planners.sampling.shortcutting import path_cost

_STEP = 0.08  # rad or m, of the joint that moves most
_DEPTH = 4  # of halving a step whose middle does not hold the constraints
_PROGRESS = 0.2  # share of a step by which it must come nearer


class ConstrainedSteps:
    """Paths of projected steps: every point holds the constraints with reserve, every middle of two holds them.

    The straight segments between points are proved free. They leave the constraints by an amount that depends on their
    length; the finished motion is checked as a whole.
    """

    def __init__(self, manifold: Manifold, check: MotionCheck, budget: Budget) -> None:
        self.manifold, self.check, self.budget = manifold, check, budget
        self.units = check.limits.velocity

    def towards(self, a: Array, b: Array, most: float = np.inf) -> list[Array]:
        """Return the points (n,) after a (n,) on the way to b (n,), at most `most` s away; b comes last where reached.

        Ends where a step is blocked, cannot be projected or comes no nearer. Source: Berenson et al. 2009 (CBiRRT).
        """
        points, here, travelled = list[Array](), a, 0.0
        while travelled < most and not self.budget.over:
            way = b - here
            far = float(np.abs(way).max())
            if far == 0.0:
                break
            if far <= _STEP:
                between = self._between(here, b, _DEPTH)
                return points if between is None else points + between
            new = self.manifold.project(here + way * (_STEP / far))
            if new is None or self._distance(new, b) > self._distance(here, b) - _PROGRESS * _STEP * self._scale(way):
                break
            between = self._between(here, new, _DEPTH)
            if between is None:
                break
            points += between
            travelled += self._distance(here, new)
            here = new
        return points

    def joined(self, a: Array, b: Array) -> list[Array] | None:
        """Return the points (n,) after a (n,) up to b (n,); None where b is not reached."""
        points = self.towards(a, b)
        return points if points and points[-1] is b else None

    def cost(self, points: Array) -> float:
        """Return the time of a path (k, n), s, as other sampling planners measure it."""
        return path_cost(points, self.units)

    def _between(self, a: Array, b: Array, depth: int) -> list[Array] | None:
        """Return the points after a up to b whose middles hold the constraints, and whose segments are free."""
        middle = 0.5 * (a + b)
        if self.manifold.holds(middle):
            return [b] if self.check.free(a, b) else None
        new = self.manifold.project(middle) if depth else None
        if new is None or np.abs(new - middle).max() > 0.5 * np.abs(b - a).max():
            return None
        first = self._between(a, new, depth - 1)
        second = None if first is None else self._between(new, b, depth - 1)
        return None if first is None or second is None else first + second

    def _distance(self, a: Array, b: Array) -> float:
        return float(np.linalg.norm((b - a) / self.units))

    def _scale(self, way: Array) -> float:
        """Return s of distance for each rad or m of the joint that moves most, along a way (n,)."""
        return float(np.linalg.norm(way / self.units) / np.abs(way).max())
