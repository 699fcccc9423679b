"""Orders of targets: whether they keep to what is stated, and random changes of them."""

from collections.abc import Sequence

import numpy as np

from optiplan.problem.task.steps import TargetTour
from optiplan.problem.task.tour_order import precedence


class OrderRules:
    """Whether an order keeps to what is stated of a tour, windows apart."""

    def __init__(self, tour: TargetTour) -> None:
        self._before = precedence(tour)
        self._clusters = np.array([target.cluster for target in tour.targets])

    def allow(self, order: Sequence[int]) -> bool:
        """Return whether targets may be visited in this order."""
        places = np.argsort(order)
        i, j = np.nonzero(self._before)
        if not (places[i] < places[j]).all():
            return False
        own = self._clusters[list(order)]
        begins = own[1:][own[1:] != own[:-1]]
        named = [name for name in (own[0], *begins) if name]
        return len(set(named)) == len(named)


def kicked(order: Sequence[int], rng: np.random.Generator) -> list[int]:
    """Return an order with two neighbouring parts exchanged (a double bridge)."""
    a, b, c = np.sort(rng.integers(0, len(order) + 1, 3)).tolist()
    return [*order[:a], *order[b:c], *order[a:b], *order[c:]]
