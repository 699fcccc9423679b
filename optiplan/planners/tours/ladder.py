"""The cheapest configurations along a tour in a given order: dynamic programming over the layers of its targets."""

from collections.abc import Mapping, Sequence
from dataclasses import field

import numpy as np

from optiplan.arrays import Array
from optiplan.planners.tours.travel_times import TravelTimes
from optiplan.planners.tours.vertices import Layer
from optiplan.problem.task.steps import TargetTour
from optiplan.records import dataclass

START = -1
"""Number of the configuration in which a tour begins, and the target that stands for it."""


@dataclass(frozen=True, eq=False)
class Choice:
    """A tour: the order of its targets and a configuration at each.

    Attributes:
        seconds: duration without what planning adds, s; infinite where there is none.
        order: targets in the order of the visits.
        Q: (m, n) the configuration at each target in that order.
        numbers: (m,) their numbers.
    """

    seconds: float
    order: tuple[int, ...]
    Q: Array
    numbers: tuple[int, ...]

    @classmethod
    def of(cls, layers: Sequence[Layer], order: Sequence[int], chosen: Sequence[int], seconds: float) -> "Choice":
        """Return a tour of the configurations at these places of the layers of its targets."""
        at = list(zip(order, chosen, strict=True))
        Q = np.array([layers[target].Q[k] for target, k in at])
        return cls(seconds, tuple(order), Q, tuple(int(layers[target].numbers[k]) for target, k in at))


@dataclass(eq=False)
class KnownLegs:
    """Durations, s, of legs that are no straight motions, by the numbers of both configurations; infinite: none."""

    seconds: dict[tuple[int, int], dict[tuple[int, int], float]] = field(default_factory=dict)

    def set(self, targets: tuple[int, int], numbers: tuple[int, int], seconds: float) -> None:
        """Record the duration of a leg between two targets."""
        self.seconds.setdefault(targets, {})[numbers] = seconds

    def of(self, targets: tuple[int, int]) -> Mapping[tuple[int, int], float]:
        """Return what is known of legs between two targets, by the numbers of their configurations."""
        return self.seconds.get(targets, {})


class Ladder:
    """Times between the layers of a tour.

    Attributes:
        tour: the tour.
        start: (n,) the configuration in which it begins, and ends if it is closed.
    """

    def __init__(self, tour: TargetTour, start: Array, times: TravelTimes) -> None:
        self.tour, self.start, self.times = tour, start, times
        self.known = KnownLegs()
        self._windows = np.array([target.window for target in tour.targets])

    @property
    def home(self) -> Layer:
        """The layer of the start."""
        return Layer(self.start[None], np.array([START]))

    def legs(self, a: int, before: Layer, b: int, after: Layer) -> Array:
        """Return the times (i, j), s, from each configuration of target a to each of b; infinite where not free."""
        found = self.times.between(before.Q, after.Q)
        for (one, other), seconds in self.known.of((a, b)).items():
            i, j = before.places.get(one), after.places.get(other)
            if i is not None and j is not None:
                found[i, j] = seconds
        return found

    def arrivals(self, departures: Array, legs: Array, target: int) -> tuple[Array, Array]:
        """Return the earliest arrivals (j,), s, at a target, and from which configuration (j,) of the one before.

        Args:
            departures: (i,) s, when the robot leaves the configurations before.
            legs: (i, j) s.
            target: to which these lead; `START`: the start.
        """
        through = departures[:, None] + legs
        came = through.argmin(axis=0)
        earliest = through[came, np.arange(through.shape[1])]
        if target != START:
            low, high = self._windows[target]
            earliest = np.where(earliest <= high, np.maximum(earliest, low), np.inf)
        return earliest, came

    def cheapest(self, layers: Sequence[Layer], order: Sequence[int]) -> Choice:
        """Return the configurations that visit the targets in this order in the least time."""
        before, at, departures = self.home, START, np.zeros(1)
        came: list[Array] = []
        for target in order:
            earliest, origin = self.arrivals(departures, self.legs(at, before, target, layers[target]), target)
            came.append(origin)
            before, at, departures = layers[target], target, earliest + self.tour.dwelling
        if self.tour.closed:
            departures = departures + self.legs(at, before, START, self.home)[:, 0]
        last = int(departures.argmin())
        chosen = [last]
        for origin in reversed(came[1:]):
            chosen.append(int(origin[chosen[-1]]))
        chosen.reverse()
        return Choice.of(layers, order, chosen, float(departures[last]))

    def between_targets(self, choice: Choice) -> Array:
        """Return the times (m + 1, m + 1), s, between the start and all targets in the configurations of a tour.

        Row and column 0 are the start's, 1 + i those of target i.
        """
        Q = np.empty((len(choice.order) + 1, len(self.start)))
        Q[0] = self.start
        Q[[1 + target for target in choice.order]] = choice.Q
        numbers = {START: START, **dict(zip(choice.order, choice.numbers, strict=True))}
        found = self.times.between(Q, Q)
        for (a, b), legs in self.known.seconds.items():
            seconds = legs.get((numbers[a], numbers[b]))
            if seconds is not None:
                found[a + 1, b + 1] = seconds
        return found

    def relaxed(self, layers: Sequence[Layer], choice: Choice) -> Array:
        """Return lower bounds (m + 1, m + 1), s, of legs one end of which may be in any configuration of its layer.

        The other end is the configuration of a tour; of both ends' bounds the smaller one. Rows are as of
        `between_targets`.
        """
        every = np.concatenate([self.start[None], *(layer.Q for layer in layers)])
        firsts = np.cumsum([0, 1, *(len(layer.Q) for layer in layers[:-1])])
        found = np.empty((len(layers) + 1, len(layers) + 1))
        for k, q in zip((START, *choice.order), (self.start, *choice.Q), strict=True):
            found[k + 1] = np.minimum.reduceat(self.times.between(q[None], every)[0], firsts)
        return np.minimum(found, found.T)
