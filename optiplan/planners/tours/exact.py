"""The best order and configurations of few targets, by dynamic programming over sets of targets (Held and Karp 1962).

With layers of configurations the state is (set, last target, its configuration). With windows it is the earliest
arrival: a robot that is earlier may wait, so nothing is lost.
"""

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from optiplan.arrays import Array
from optiplan.planners.tours.ladder import START, Choice, Ladder
from optiplan.planners.tours.vertices import Layer
from optiplan.problem.task.tour_order import precedence

_MOST_DOUBLED = 900
"""Exponent of 2 above which a count of pairs only has to be a number: a power of it beyond 1023 is none."""


def work_of(layers: Sequence[Layer]) -> float:
    """Return about how many pairs of configurations are compared: 2^(m - 2) (sum of all configurations)²."""
    return float(2.0 ** min(len(layers) - 2, _MOST_DOUBLED) * sum(len(layer.Q) for layer in layers) ** 2)


def best_tour(ladder: Ladder, layers: Sequence[Layer]) -> Choice | None:
    """Return the shortest tour over these configurations among all orders as stated; None where there is none."""
    m = len(layers)
    allowed = _Allowed(ladder)
    legs = {
        (a, b): ladder.legs(a, ladder.home if a == START else layers[a], b, layers[b])
        for a in (START, *range(m))
        for b in range(m)
        if a != b
    }
    arrived: dict[tuple[int, int], Array] = {}
    came: dict[tuple[int, int], tuple[Array, Array]] = {}
    for size in range(1, m + 1):
        for members in combinations(range(m), size):
            key = sum(1 << k for k in members)
            for last in members:
                rest = key & ~(1 << last)
                sources = [START] if not rest else [k for k in members if (rest, k) in arrived]
                found = []
                for k in sources:
                    if allowed.next(rest, k, last):
                        departures = np.zeros(1) if k == START else arrived[rest, k] + ladder.tour.dwelling
                        found.append((k, *ladder.arrivals(departures, legs[k, last], last)))
                if found:
                    seconds = np.array([one[1] for one in found])
                    best = seconds.argmin(axis=0)
                    columns = np.arange(len(best))
                    arrived[key, last] = seconds[best, columns]
                    origins = np.array([one[2] for one in found])[best, columns]
                    came[key, last] = np.array([one[0] for one in found])[best], origins
    return _traced(ladder, layers, arrived, came)


def _traced(
    ladder: Ladder,
    layers: Sequence[Layer],
    arrived: dict[tuple[int, int], Array],
    came: dict[tuple[int, int], tuple[Array, Array]],
) -> Choice | None:
    full = (1 << len(layers)) - 1
    ends = []
    for last in range(len(layers)):
        if (full, last) in arrived:
            seconds = arrived[full, last] + ladder.tour.dwelling
            if ladder.tour.closed:
                seconds = seconds + ladder.legs(last, layers[last], START, ladder.home)[:, 0]
            ends.append((float(seconds.min()), last, int(seconds.argmin())))
    if not ends or not np.isfinite(min(ends)[0]):
        return None
    seconds_of_all, last, k = min(ends)
    order, chosen, key = [last], [k], full
    while True:
        targets, origins = came[key, last]
        key &= ~(1 << last)
        last, k = int(targets[k]), int(origins[k])
        if last == START:
            break
        order.append(last)
        chosen.append(k)
    order.reverse()
    chosen.reverse()
    return Choice.of(layers, order, chosen, seconds_of_all)


class _Allowed:
    """Which target may follow on a set of visited ones: precedence, and clusters in one go."""

    def __init__(self, ladder: Ladder) -> None:
        before, targets = precedence(ladder.tour), ladder.tour.targets
        self._before = [sum(1 << int(k) for k in np.flatnonzero(before[:, j])) for j in range(len(targets))]
        names = [target.cluster for target in targets]
        self._names = names
        self._members = {name: sum(1 << k for k, one in enumerate(names) if one == name) for name in names if name}

    def next(self, visited: int, last: int, target: int) -> bool:
        """Return whether `target` may follow on the set `visited`, whose last one is `last`."""
        if self._before[target] & ~visited:
            return False
        own = "" if last == START else self._names[last]
        return not own or own == self._names[target] or not self._members[own] & ~visited
