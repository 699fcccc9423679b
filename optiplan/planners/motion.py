"""Quick check of straight motions between configurations: what samplers ask thousands of times."""

from functools import lru_cache
from itertools import pairwise

import numpy as np

from optiplan.arrays import Array
from optiplan.model.collision import CollisionModel
from optiplan.planners.torque import Gravity


class MotionCheck:
    """Is the straight segment from a to b free at steps of `step` (rad or m, largest joint), ends included?

    With `gravity`, configurations in which the motors cannot hold the arm count as blocked too. It proves nothing
    between the steps. Where a proof failed there, `block` remembers the place: later motions that pass it are refused,
    whatever their step.
    """

    def __init__(self, model: CollisionModel, step: float, gravity: Gravity | None = None) -> None:
        self.model, self.step, self.gravity = model, step, gravity
        self._blocked = np.zeros((0, model.robot.n))
        self._radius = np.zeros(0)

    def block(self, q: Array, radius: float) -> None:
        """Refuse motions that come within `radius` (2-norm, rad or m) of q (n,)."""
        self._blocked = np.vstack([self._blocked, q])
        self._radius = np.append(self._radius, radius)

    def blocked(self, q: Array) -> bool:
        """Whether q (n,) collides, or is too heavy to hold."""
        return self.model.collides(q) or (self.gravity is not None and self.gravity.too_much(q))

    def free(self, a: Array, b: Array) -> bool:
        """Whether no step of the segment collides and no blocked place is passed; a, b (n,), `a` known to be free."""
        d = b - a
        if len(self._radius) and self._passes_blocked(a, d):
            return False
        parts = max(1, int(np.ceil(np.abs(d).max() / self.step)))
        return not any(self.blocked(a + d * fraction) for fraction in _far_apart_first(parts))

    def polyline_free(self, waypoints: Array) -> bool:
        """The same for every segment between waypoints (k, n)."""
        return all(self.free(a, b) for a, b in pairwise(waypoints))

    def _passes_blocked(self, a: Array, d: Array) -> bool:
        to = self._blocked - a
        fraction = np.clip(to @ d / max(float(d @ d), 1e-30), 0.0, 1.0)
        return bool((np.linalg.norm(to - fraction[:, None] * d, axis=1) < self._radius).any())


@lru_cache(maxsize=4096)
def _far_apart_first(parts: int) -> tuple[float, ...]:
    """The fractions 1/parts … 1: the end, the middle, the quarters, …; collisions are met sooner in that order."""
    order, spans = [parts], [(1, parts - 1)]
    for low, high in spans:
        if low <= high:
            middle = (low + high) // 2
            order.append(middle)
            spans += [(low, middle - 1), (middle + 1, high)]
    return tuple(k / parts for k in order)
