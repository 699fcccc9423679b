"""Find a tour: its order, the configuration at each target and the motions between them, better and better.

The vertices are the configurations at the targets, layer by layer. In a given order the cheapest ones are found by
dynamic programming (`ladder`). Between the chosen ones a search of orders (`order`, `exact`) looks for a better order.
Both alternate. Then configurations are added around the chosen ones, at smaller and smaller steps of what is free.
Straight motions are checked as soon as a tour uses them; one that is not free is planned, and counts as long as that.
"""

from collections.abc import Callable, Sequence
from dataclasses import field, replace
from itertools import pairwise
from typing import Any

import numpy as np

from optiplan.arrays import Array
from optiplan.collision.model import CollisionModel
from optiplan.planners.base import Budget, Failure, Planner, Progress
from optiplan.planners.common.failures import out_of_time, with_reason
from optiplan.planners.common.gravity import Gravity
from optiplan.planners.sampling.edge_checker import MotionCheck
from optiplan.planners.tours.exact import best_tour, work_of
from optiplan.planners.tours.ladder import START, Choice, Ladder
from optiplan.planners.tours.legs import Numbers, TourLegs
from optiplan.planners.tours.order import OrderSearch
from optiplan.planners.tours.order_rules import OrderRules, kicked
from optiplan.planners.tours.travel_times import TravelTimes
from optiplan.planners.tours.vertices import Layer, Vertices
from optiplan.problem.problem import Problem
from optiplan.problem.task.steps import TargetTour
from optiplan.records import dataclass
from optiplan.trajectory.joining import standstill
from optiplan.trajectory.trajectory import Trajectory

EXACT = 2e7
"""Pairs of configurations that the exact search compares at most, a tenth of a second."""

_BLOCKED = 1.15, 0.15
"""A straight motion that is not free counts as so many times as long, and s longer, until it is planned."""

_SETTLING, _REPLANNING = (20, 8), 4
"""Rounds of dynamic programming until the legs of few and of many targets are free, and until their planned durations
are known."""

_TURNS = 36, 24
"""Turns about a free axis that are tried first, of few targets and of many."""

_FINER, _STEPS = 0.6, 8
"""Factor of one step about the free axis to the next, and how many."""

_REORDERING = 3
"""Steps of finer configurations, after which the order is searched again."""

_ROUNDS = 60
"""Solutions of guided local search in a search of orders that is to leave a local optimum."""

_ALTERNATING = 12
"""Orders and configurations in turn, at most."""

_KICKS, _FEW = 12, 30
"""Random exchanges in a tour of at most so many targets."""

_SURPRISE = 1e-3
"""Share of its duration by which a leg differs from what it counted, so that the new duration counts."""

_NO_GAIN = 1e-4
"""Share of the duration: less is no gain."""

_TOLD = 5e-3
"""Share of the duration by which a tour is shorter than the last one reported on the way."""

_STALE = 2
"""Rounds without a gain after which a search ends."""

_METRE, _RADIAN = 2.0, 0.4
"""s per m and rad of the tool, for a first order."""


@dataclass(frozen=True, eq=False)
class FoundTour:
    """A tour that is planned.

    Attributes:
        order: targets in the order of the visits.
        Q: (m, n) the configuration at each of them.
        legs: the motion to each, and back if the tour is closed; None where the robot is there already.
        seconds: duration with what is done at the targets, s.
    """

    order: tuple[int, ...]
    Q: Array
    legs: tuple[Trajectory | None, ...]
    seconds: float


@dataclass(eq=False)
class TourSearch:
    """One search.

    Attributes:
        problem: of the joints that move; its start is where the tour begins.
        budget: time for better and better tours.
        found: called with tours on the way, each noticeably better than the one before.
        longest: time until there is a first tour.
        best: of those planned so far.
        exact: pairs of configurations up to which the best order is found by comparing all.
        rounds: done so far.
        failure: of the last tour whose legs could not all be planned, or are late.
        earlier: the first such failure but for lack of time.
        settling: rounds of dynamic programming in which straight motions that are not free are left, at most.
    """

    problem: Problem
    tour: TargetTour
    model: CollisionModel
    planner: Planner[Any]
    budget: Budget
    progress: Progress
    found: Callable[[FoundTour], None]
    longest: Budget
    best: FoundTour | None = None
    exact: float = EXACT
    rounds: int = 0
    failure: Failure | None = None
    earlier: Failure | None = None
    info: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        limits = self.problem.limits
        check = MotionCheck(self.model, limits, Gravity(self.problem.robot, limits.torque))
        times = TravelTimes(limits)
        self.vertices = Vertices(self.problem, self.tour, check, times)
        self.ladder = Ladder(self.tour, self.problem.start, times)
        self.legs = TourLegs(self.problem, check, self.planner, self.progress)
        self._orders: OrderSearch | None = None
        self._many = len(self.tour.targets) > _FEW
        self._turns, self.settling = _TURNS[self._many], _SETTLING[self._many]
        self._told, self._stopped = np.inf, False
        self._kept: Choice | None = None
        self._rules = OrderRules(self.tour)

    @property
    def _time(self) -> Budget:
        """The time that the search has."""
        return self.longest if self.best is None and self.budget.over else self.budget

    def run(self) -> FoundTour | Failure:
        """Search until nothing is gained any more or the budget is over; the best tour counts."""
        self.progress("configurations of the targets", 0.0)
        layers = self.vertices.first(self.longest, self._turns)
        if isinstance(layers, Failure):
            return layers
        self.info["configurations"] = sum(len(layer.Q) for layer in layers)
        choice = self.first(layers)
        if isinstance(choice, Failure):
            return choice
        choice, stale = self.offer(layers, choice), 0
        while stale < _STALE and not self._time.over:
            self.progress("tour", 1.0 - self._time.remaining / max(self._time.seconds, 1e-9))
            before = np.inf if self.best is None else self.best.seconds
            choice = self._refined(self.improved(layers, choice), stale)
            self.rounds += 1
            choice = self.offer(layers, choice)
            gained = self.best is not None and self.best.seconds < before * (1.0 - _NO_GAIN)
            stale = 0 if gained and self.tour.free else stale + 1
        self.info |= {"legs_planned": self.legs.planned, "cut_short": self._time.over}
        late = self.failure or out_of_time(self._time, "looking for a tour")
        return self.best or with_reason(late, self.earlier)

    def first(self, layers: Sequence[Layer]) -> Choice | Failure:
        """Return a tour in a first order."""
        if not self.tour.free:
            order: Sequence[int] | None = range(len(layers))
        elif work_of(layers) <= self.exact:
            exact = self._best_of_all(layers)
            order = None if exact is None else exact.order
        else:
            order = self._order_search().improved(self._estimates(layers), None, 0, 0.3 * self._time.remaining)
        choice = None if order is None else self._settled(layers, order)
        if choice is None or not np.isfinite(choice.seconds):
            timed = any(target.window != (0.0, np.inf) for target in self.tour.targets)
            why = f"no order of the targets was found that keeps to {'their windows' if timed else 'what is stated'}"
            return out_of_time(self._time, "looking for an order") if self._time.over else Failure("no-path", why)
        return choice

    def _order_search(self) -> OrderSearch:
        if self._orders is None:
            self._orders = OrderSearch(self.tour)
        return self._orders

    def _estimates(self, layers: Sequence[Layer]) -> Array:
        """Return estimated times (m + 1, m + 1), s: by how far the tool goes; with windows the least of all."""
        every = [self.ladder.home, *layers]
        m = len(every)
        if any(target.window != (0.0, np.inf) for target in self.tour.targets):
            least = [[self.ladder.times.between(a.Q, b.Q).min() for b in every] for a in every]
            return np.array(least)
        poses = [goal.X_WR.homogeneous for goal in self.vertices.goals]
        places = np.array([X[:3, 3] for X in poses])
        far = np.linalg.norm(places[:, None] - places[None], axis=2)
        axes = np.array([X[:3, (goal.free or (2,))[0]] for X, goal in zip(poses, self.vertices.goals, strict=True)])
        turned = np.arccos(np.clip(axes @ axes.T, -1.0, 1.0))
        found = np.zeros((m, m))
        found[1:, 1:] = _METRE * far + _RADIAN * turned
        found[0, 1:] = found[1:, 0] = [self.ladder.times.between(self.ladder.home.Q, b.Q).min() for b in layers]
        return found

    def _alternated(self, layers: Sequence[Layer], choice: Choice, rounds: int) -> Choice:
        """Improve order and configurations in turn while that gains.

        With `rounds` of guided local search the first order is one for the relaxed times: either end of a leg free.
        """
        best = choice
        layers = self.vertices.joined(_layers_of(choice), layers)
        for k in range(_ALTERNATING):
            other = self._reordered(layers, best, rounds, relaxed=rounds > 0 and k == 0) or best
            gained = other.seconds < best.seconds * (1.0 - _NO_GAIN)
            best = other if other.seconds < best.seconds else best
            if self._time.over or not self.tour.free or not (gained or (rounds > 0 and k == 0)):
                break
        return best

    def improved(self, layers: Sequence[Layer], choice: Choice) -> Choice:
        """Improve a tour by searches of orders over the configurations of the layers alone."""
        return self._kicked(layers, self._alternated(layers, choice, 0 if self.rounds == 0 else _ROUNDS))

    def _kicked(self, layers: Sequence[Layer], choice: Choice) -> Choice:
        """Exchange parts of a small tour at random, improve that, and keep what is better."""
        rng = np.random.default_rng(self.problem.seed)
        few = self.tour.free and not self._many and work_of(layers) > self.exact
        for _ in range(_KICKS if few and self.rounds == 0 else 0):
            order = kicked(choice.order, rng)
            if self._time.over or not self._rules.allow(order):
                continue
            other = self._alternated(layers, self._settled(layers, order), 0)
            choice = other if other.seconds < choice.seconds else choice
        return choice

    def _reordered(
        self, layers: Sequence[Layer], choice: Choice, rounds: int, *, relaxed: bool = False
    ) -> Choice | None:
        """Return a tour in an order that is better for the configurations of a tour, or for all of the layers."""
        if not self.tour.free:
            return self._settled(layers, choice.order)
        if work_of(layers) <= self.exact:
            return self._best_of_all(layers)
        seconds = self.ladder.relaxed(layers, choice) if relaxed else self.ladder.between_targets(choice)
        order = self._order_search().improved(seconds, choice.order, rounds, 0.2 * self._time.remaining)
        return None if order is None else self._settled(layers, order)

    def _best_of_all(self, layers: Sequence[Layer]) -> Choice | None:
        """Return the best tour of all orders and configurations whose straight motions are free, see `_settled`."""
        for _ in range(self.settling):
            choice = best_tour(self.ladder, layers)
            if choice is None or not self._blocked(choice):
                break
        return choice

    def _refined(self, choice: Choice, stale: int) -> Choice:
        """Improve the configurations with further ones around them, at smaller and smaller steps."""
        step = 2.0 * np.pi / self._turns * 0.5 * _FINER**stale
        for k in range(_STEPS):
            if self._time.over:
                break
            layers = self._around(choice, step * _FINER**k)
            better = self._settled(layers, choice.order)
            choice = better if better.seconds < choice.seconds else choice
            if k % _REORDERING == _REORDERING - 1:
                choice = self._alternated(layers, choice, 0)
        return choice

    def _around(self, choice: Choice, step: float) -> list[Layer]:
        """Return layers of the chosen configurations and others near them."""
        places = np.argsort(choice.order)
        ways = np.concatenate([self.ladder.home.Q, choice.Q, self.ladder.home.Q if self.tour.closed else choice.Q[-1:]])
        chosen, before, after = choice.Q[places], ways[:-2][places], ways[2:][places]
        return self.vertices.joined(_layers_of(choice), self.vertices.near(chosen, before, after, step))

    def _settled(self, layers: Sequence[Layer], order: Sequence[int]) -> Choice:
        """Return the cheapest configurations whose straight motions are free, as far as there are such."""
        for _ in range(self.settling):
            choice = self.ladder.cheapest(layers, order)
            if not np.isfinite(choice.seconds) or not self._blocked(choice):
                break
        return choice

    def _blocked(self, choice: Choice) -> bool:
        """Check the straight motions of a tour; return whether there is one that was not known not to be free."""
        some = False
        for targets, numbers, a, b in self._ways(choice):
            if numbers in self.ladder.known.of(targets) or self.legs.straight(numbers, a, b):
                continue
            seconds = float(self.ladder.times.along(np.array([a, b]))[0])
            self.ladder.known.set(targets, numbers, _BLOCKED[0] * seconds + _BLOCKED[1])
            some = True
        return some

    def _ways(self, choice: Choice) -> list[tuple[tuple[int, int], Numbers, Array, Array]]:
        """Return the legs of a tour: targets, numbers and configurations (n,) at both ends."""
        home = [START] if self.tour.closed else []
        targets = [START, *choice.order, *home]
        numbers = [START, *choice.numbers, *home]
        Q = [self.ladder.start, *choice.Q, *([self.ladder.start] if home else [])]
        return list(zip(pairwise(targets), pairwise(numbers), Q, Q[1:], strict=False))

    def offer(self, layers: Sequence[Layer], choice: Choice) -> Choice:
        """Plan what is not straight; where that takes longer than thought, choose again. Keep and report a better tour.

        Returns:
            The tour to go on from, with its duration as it is known now: the best one, once there is one.
        """
        every = self.vertices.joined(_layers_of(choice), layers)
        for _ in range(_REPLANNING):
            self.failure = None
            surprised = self._planned(choice)
            if self.failure is None:
                self._keep(choice)
            if self._stopped or not surprised:
                break
            again = self._settled(every, choice.order)
            if not np.isfinite(again.seconds) or again.numbers == choice.numbers:
                break
            choice = again
        kept = self._kept or choice
        return self.ladder.cheapest(_layers_of(kept), kept.order)

    def _planned(self, choice: Choice) -> bool:
        """Plan the legs of a tour, and record what they take; return whether one takes longer than it counted."""
        surprised, self._stopped = False, False
        for targets, numbers, a, b in self._ways(choice):
            motion = self.legs.motion(numbers, a, b, self._time)
            if isinstance(motion, Failure):
                self.failure = replace(motion, detail=f"{self._words(targets)}: {motion.detail}")
                self._stopped = motion.kind in ("budget", "cancelled")
                if self._stopped:
                    return True
                self.earlier = self.earlier or self.failure
            seconds = np.inf if isinstance(motion, Failure) else 0.0 if motion is None else motion.duration
            thought = self.ladder.known.of(targets).get(numbers)
            counted = float(self.ladder.times.along(np.array([a, b]))[0]) if thought is None else thought
            if abs(seconds - counted) > _SURPRISE * counted:
                self.ladder.known.set(targets, numbers, seconds)
                surprised |= seconds > counted
        return surprised

    def _keep(self, choice: Choice) -> None:
        """Keep a tour of which all legs are planned, if it is the best; one that is late is a failure."""
        legs: list[Trajectory | None] = []
        now = 0.0
        for (_, target), numbers, a, b in self._ways(choice):
            motion = self.legs.motion(numbers, a, b, self._time)
            assert not isinstance(motion, Failure)
            low, high = (0.0, np.inf) if target == START else self.tour.targets[target].window
            arrival = now + (0.0 if motion is None else motion.duration)
            if arrival > high:
                name = self.tour.targets[target].name
                words = (
                    f"'{name}' is reached at {arrival:.4g} s of the tour, after its window, which ends at {high:g} s"
                )
                self.failure = Failure("no-path", words)
                self.earlier = self.earlier or self.failure
                return
            if arrival < low:
                names = self.problem.robot.joint_names
                motion = standstill(names, a, low - now) if motion is None else motion.scaled(low - now)
            now = max(arrival, low) + (0.0 if target == START else self.tour.dwelling)
            legs.append(motion)
        if self.best is None or now < self.best.seconds * (1.0 - _NO_GAIN):
            self._kept = choice
            self.best = FoundTour(choice.order, choice.Q, tuple(legs), now)
            if now < self._told * (1.0 - _TOLD):
                self._told = now
                self.found(self.best)

    def _words(self, targets: tuple[int, int]) -> str:
        names = ["the start" if k == START else f"'{self.tour.targets[k].name}'" for k in targets]
        return f"from {names[0]} to {names[1]}"


def _layers_of(choice: Choice) -> list[Layer]:
    """Return the configurations of a tour as layers, by target."""
    return [Layer(choice.Q[k : k + 1], np.array(choice.numbers[k : k + 1])) for k in np.argsort(choice.order)]
