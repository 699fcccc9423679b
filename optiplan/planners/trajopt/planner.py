"""`trajopt`: optimise several initial guesses and return the best collision-free motion."""

from collections.abc import Iterable, Iterator
from copy import deepcopy
from itertools import count
from typing import Any

import numpy as np

from optiplan.arrays import Array
from optiplan.collision.kept_models import kept_planning_model
from optiplan.collision.native_model import not_in_core
from optiplan.libraries import clock
from optiplan.planners.base import Budget, Failure, Planner, PlanResult, Progress, silent
from optiplan.planners.common.context import Stopwatch
from optiplan.planners.common.continuous_collision import first_contact
from optiplan.planners.common.failures import out_of_time
from optiplan.planners.common.goal_ranking import GoalSampler, goal_sampler
from optiplan.planners.common.path_timing import within_torque
from optiplan.planners.sampling.sample_path import NoPath
from optiplan.planners.sampling.shortcutting import path_time
from optiplan.planners.trajopt.attempts import Attempts
from optiplan.planners.trajopt.coarse_descents import CoarseDescents, GuessPath
from optiplan.planners.trajopt.curve_incumbent import CurveIncumbent
from optiplan.planners.trajopt.end_search import EndSearch
from optiplan.planners.trajopt.initial_guess import with_bump
from optiplan.planners.trajopt.optimizer import Attempt, Optimiser, finer_basis
from optiplan.planners.trajopt.options import TrajOptOptions
from optiplan.planners.trajopt.path_search import PathSearch
from optiplan.planners.trajopt.program.sqp import WORSE
from optiplan.planners.trajopt.seedless_search import SeedlessSearch
from optiplan.planners.trajopt.stopping_rule import Patience
from optiplan.problem.problem import Problem
from optiplan.trajectory.timing.stops import stop_at_corners
from optiplan.trajectory.trajectory import Trajectory

_EARLY = 1.0 / 3.0
"""Share of the budget for straight lines before the first motion; the rest is for sampled paths."""

_MOVED = 2
"""Ends of a goal that are moved towards the start before a first motion is searched; the others are after it."""

_SEEN = 0.5, 0.3, 0.7, 0.15, 0.85
"""Places on a straight line, as shares of it, where bodies must not touch for it to be timed and proved."""

_BEATEN = 1.1
"""Cost of the first curve along a path / cost of the line's, above which the path is not optimised further."""

_SHORTER = 0.95
"""Cost after shortcuts / cost before, below which a path on an optimised curve is optimised again."""

_IN_VAIN = 3
"""Attempts in vain before a sampled path is timed with rounded corners, which takes as long as an attempt."""

_BUMPS = 4
"""Period, in rounds, of attempts from the best curve with a bump."""

_DENSE = 300
"""Waypoints on a curve; their chords are proved free instead of the curve."""


class TrajOpt(Planner[TrajOptOptions]):
    """Minimum-time B-splines by sequential quadratic programming, from straight lines and sampled paths.

    Every motion proved free is a candidate: straight lines and sampled paths with exact timing, and optimised curves.
    The best of them is the answer. Attempts continue while a gain is expected (`Patience`). They start in turn from a
    new sampled path, a straight line with a bump and the best curve with a bump. The best curve is optimised once more
    with twice the spans.
    """

    Options = TrajOptOptions

    joins_legs = True
    holds_constraints = True
    end_derivatives = 2
    times_obstacles = True

    def plan(self, problem: Problem, budget: Budget, progress: Progress) -> PlanResult:
        """Plan within the budget; see `planners.base.Planner`."""
        if problem.scene.dynamic_obstacles:
            from optiplan.planners.trajopt.optimise_in_time import optimise_in_time

            return optimise_in_time(self, problem, budget, progress)
        if problem.nonzero_ends:
            from optiplan.planners.trajopt.nonzero_ends import plan_nonzero_ends

            return plan_nonzero_ends(self, problem, budget, progress)
        return _Run(problem, budget, progress, self.options).result()

    def replan(self, problem: Problem, earlier: Trajectory, budget: Budget, progress: Progress) -> PlanResult:
        """Plan from an earlier motion; search for another way where the result is worse. See `warm`."""
        from optiplan.planners.trajopt.warm import WarmStart

        warm = WarmStart(problem, earlier, self.options, budget, progress)
        if warm.good or (warm.best is not None and budget.over):
            return warm.result()
        return warm.with_search(self.plan(problem, budget, progress))

    def near(self, problem: Problem, earlier: Trajectory, budget: Budget) -> Trajectory | None:
        """Optimise an earlier motion; see `planners.base.Planner`. Twice the spans are those of a refined curve."""
        from optiplan.planners.trajopt.warm import WarmStart

        return WarmStart(problem, earlier, self.options, budget, silent, finer_basis(self.options)).best


class _Run:
    """State of one call: the best motions so far, the searches for paths, the failure."""

    def __init__(self, problem: Problem, budget: Budget, progress: Progress, options: TrajOptOptions) -> None:
        self.problem, self.budget, self.options = problem, budget, options
        began, self.watch = clock(), Stopwatch()
        self.info: dict[str, Any] = {"attempts": [], "cut_short": False}
        self.direct = True  # whether straight lines, with or without a bump, are still tried
        self.repaired: tuple[Attempt, float] | None = None  # what the last path lies on, and that path's cost, s
        self.patience = Patience(budget, options.good_enough)
        with self.watch.stage("set-up"):
            self.model = kept_planning_model(problem.robot, problem.scene, problem.tracking_error)
            self.info.update(not_in_core(self.model))
            self.optimiser = Optimiser(problem, self.model, options)
        self.incumbent = CurveIncumbent(
            problem, progress, self.watch, began, constraints=self.optimiser.constraints, info=self.info
        )
        coarse = CoarseDescents(self.optimiser, budget, self.patience, self.watch)
        self.paths = PathSearch(problem, self.model, budget, self.patience, self.incumbent, self.watch, coarse)
        self.attempts = Attempts(self.optimiser, budget, self.incumbent, self.patience, self.watch)

    def result(self) -> PlanResult:
        """Search and return the best motion, or the failure."""
        try:
            failure = self._search()
        finally:
            self.attempts.ahead.close()
        if self.options.workers > 1:
            self.info["workers"] = {"count": self.options.workers, "attempts_of_threads": self.attempts.ahead.used}
        self.attempts.free_end()
        self.attempts.refine()
        self.attempts.finest()
        self.info["cut_short"] |= self.budget.over
        if self.budget.cancelled:
            failure = out_of_time(self.budget, "looking for a trajectory")
        return self.incumbent.result(self.info, failure)

    def _search(self) -> Failure | None:
        with self.watch.stage("goals"):
            sampler = goal_sampler(self.problem, self.model, self.budget, moved=_MOVED)
        if isinstance(sampler, Failure):
            return sampler
        goals = list(sampler.configurations)
        if self.problem.path_constraints:
            from optiplan.planners.path_constraints.goal_projection import hold_goals

            goals = hold_goals(self.problem, self.model, sampler, self.optimiser.constraints, lambda: self.budget.over)
        if not goals:
            return self.optimiser.constraints.no_end(sampler.configurations)
        first = goals[0]
        if self._stands_in(goals):
            return None
        failure: Failure | None = None
        if self.options.straight_goals:
            self._straight(first)
            failure = self.paths.at_once(sampler)
        with self.watch.stage("goals"):
            sampler.move(lambda: self.budget.over)
        goals = [q for q in sampler.configurations if self.optimiser.constraints.end_holds(q)]
        if self._stands_in(goals):
            return None
        self._along_lines(goals, first)
        return self._further(sampler, failure)

    def _stands_in(self, goals: list[Array]) -> bool:
        """Take the bound of ends (n,), the soonest first; offer rest, and return True, where that is the start."""
        soonest = float(self.problem.lower_bounds(goals[:1])[0])
        self.incumbent.bounded(soonest)
        if soonest == 0.0:
            ends, limits = np.array([self.problem.start, goals[0]]), self.problem.limits
            self.incumbent.offer(stop_at_corners(ends, limits, self.problem.robot.joint_names))
        return soonest == 0.0

    def _along_lines(self, goals: list[Array], known: Array) -> None:
        """Optimise from straight lines to ends (n,), the soonest first; that to the `known` one has been offered."""
        start, early = self.problem.start, self.budget.share(_EARLY)
        tried = goals[: self.options.straight_goals]
        bounds = self.problem.lower_bounds(goals)
        for k, (goal, bound) in enumerate(zip(tried, bounds, strict=False)):
            if (
                early.over
                or self.incumbent.cost_bound(float(bound)) >= self.incumbent.cost
                or not self._should_continue()
            ):
                break
            if len(tried) > 1:
                self._precompute(self.optimiser.along(np.array([start, other])) for other in tried[k:])
            if not np.array_equal(goal, known):
                self._straight(goal)
            if self._should_continue():
                within = self.budget if self.incumbent.candidates else early
                control = self.optimiser.along(np.array([start, goal]))
                before = self.incumbent.cost
                straight = self.attempts.attempt("straight", control, within)
                self.direct = straight is not None
                if self.direct and before > _BEATEN * self.incumbent.cost:
                    self.paths.found = None
        self.info["cut_short"] = early.over and not self.incumbent.candidates

    def _further(self, sampler: GoalSampler, failure: Failure | None) -> Failure | None:
        """Try sampled paths, lines with a bump and the best curve with a bump in turn, while `Patience` allows.

        A failed line skips further lines until a path search fails too. After every round, and in the end, further
        ends of the goal are tried where their bounds make it worthwhile. Where nothing is found, the last failure is
        returned; until then that is the one given.
        """
        rng = np.random.default_rng(self.problem.seed)
        ends = EndSearch(sampler, self.attempts, self.paths)
        seedless = SeedlessSearch(self.attempts, self.paths)
        for number in range(self.options.seeds):
            if not self._should_continue():
                break
            self._precompute(self._coming(sampler, number, rng))
            self.repaired = None
            guess = self.paths.next(sampler, self._repaired)
            if isinstance(guess, Failure):
                failure = guess
                self.direct = self.attempts.patient = True
                self.attempts.keep(None)
            elif len(guess.path.waypoints) > 2 or self.incumbent.curve is None:
                failure = self._sampled(guess) or failure
            if self.direct and self._should_continue():
                self._precompute(self._coming(sampler, number, rng))
                control = self._with_bump(self._line(sampler, number), rng)
                self.direct = self.attempts.attempt("line", control, self.attempts.before_refining) is not None
            if number % _BUMPS == _BUMPS - 1 and self.incumbent.curve is not None and self._should_continue():
                self._precompute(self._coming(sampler, number, rng, line=False))
                control = self._with_bump(self.incumbent.curve.control, rng)
                self.attempts.attempt("bump", control, self.attempts.before_refining)
            ends.run()
            seedless.run()
        ends.run()
        seedless.run()
        if self.incumbent.candidates:
            return None
        if isinstance(failure, NoPath):
            return failure.explained()
        return failure if failure is not None else self.attempts.why_not()

    def _coming(
        self, sampler: GoalSampler, number: int, rng: np.random.Generator, line: bool = True
    ) -> Iterator[Array]:
        """Yield the curves with a bump for attempts from round `number` on, if none of them gains."""
        rng = deepcopy(rng)
        for k in count(number) if self.direct or self.incumbent.curve is not None else ():
            if self.direct and (line or k > number):
                yield self._with_bump(self._line(sampler, k), rng)
            if k % _BUMPS == _BUMPS - 1 and self.incumbent.curve is not None:
                yield self._with_bump(self.incumbent.curve.control, rng)

    def _line(self, sampler: GoalSampler, number: int) -> Array:
        """Return control points (K, n) of the straight line to one promising goal, a different one for each number.

        Where none promises a shorter motion, it is to any.
        """
        goals = self.paths.promising(sampler) or sampler.configurations
        return self.optimiser.along(np.array([self.problem.start, goals[number % len(goals)]]))

    def _with_bump(self, control: Array, rng: np.random.Generator) -> Array:
        limits = self.problem.limits
        duration = self.optimiser.basis.shortest_duration(control, limits.rates)
        return with_bump(self.optimiser.basis, control, duration, limits, rng)

    def _sampled(self, guess: GuessPath) -> Failure | None:
        """Optimise from a sampled path, and time the path itself after several attempts in vain.

        A path on an optimised curve is not optimised again unless a shortcut has made it shorter. A path that takes
        far longer than the best motion, even at full speed, is skipped.
        """
        path, curve, failure, attempt = guess.path, guess.curve, None, None
        if not self.incumbent.candidates and (curve is None or self.paths.free(path.waypoints)):
            failure = self.paths.offer_first(path)
        repaired, self.repaired = self.repaired, None
        if repaired is not None and path.cost > _SHORTER * repaired[1]:
            attempt = repaired[0]
            self.attempts.keep(attempt)
        elif self._hopeless(guess):
            self.attempts.keep(None)
        else:
            control = self.optimiser.along(path.waypoints) if curve is None else curve.control
            attempt = self.attempts.attempt("sampled", control, self.attempts.before_refining)
            self.paths.record(attempt is not None)
        longer = self.incumbent.cost > self.incumbent.cost_bound(path.cost)
        if attempt is None and longer and self.patience.in_vain >= _IN_VAIN and self.paths.free(path.waypoints):
            self.paths.offer_timed(path)
        return failure

    def _hopeless(self, guess: GuessPath) -> bool:
        """Return whether a guess promises no improvement of the best curve."""
        incumbent = self.incumbent
        if guess.curve is None or incumbent.curve is None:
            return incumbent.cost_bound(guess.path.cost) > WORSE * incumbent.cost
        return incumbent.cost_bound(guess.curve.duration) > incumbent.rough

    def _repaired(self, waypoints: Array) -> Array | None:
        """Return waypoints on the optimised curve of a colliding path, if that is free."""
        attempt = self.attempts.optimised("relaxed", self.optimiser.along(waypoints), self.budget)
        if attempt is None:
            return None
        self.incumbent.offer_curve(attempt)
        dense = self.optimiser.basis.at(np.linspace(0.0, 1.0, _DENSE)) @ attempt.control
        dense[0], dense[-1] = waypoints[0], waypoints[-1]
        self.repaired = attempt, float(path_time(dense, self.problem.limits.velocity).sum())
        return dense

    def _straight(self, goal: Array) -> None:
        """Offer the straight line to an end (n,), timed exactly, if it is free."""
        with self.watch.stage("straight line"):
            problem, ends = self.problem, np.array([self.problem.start, goal])
            if any(self.model.collides((1.0 - share) * ends[0] + share * ends[1]) for share in _SEEN):
                return
            line = stop_at_corners(ends, problem.limits, problem.robot.joint_names)
            if first_contact(self.model, line, lambda: self.budget.over) is None:
                timed = within_torque(problem.robot, problem.limits, line)
                if timed is not None:
                    self.incumbent.offer(timed)

    def _precompute(self, curves: Iterable[Array]) -> None:
        """Let other threads begin likely attempts."""
        self.attempts.ahead.precompute(curves, self.incumbent.cost, self.attempts.patient)

    def _should_continue(self) -> bool:
        """Return whether the budget and `Patience` allow another attempt; a path that was found is optimised."""
        if self.attempts.over:
            self.info["cut_short"] = True
            return False
        due = self.paths.found is not None and not self.incumbent.within(self.options.good_enough)
        return (
            not self.incumbent.candidates
            or due
            or self.patience.worth_another(self.incumbent.cost, self.incumbent.bound)
        )
