"""`trajopt`: optimise several initial guesses and return the best motion that is free at all times."""

import time
from collections.abc import Callable, Iterator
from copy import deepcopy
from dataclasses import replace
from itertools import count
from typing import Any, Literal

import numpy as np

from optiplan.arrays import Array
from optiplan.collision.kept_models import kept_planning_model
from optiplan.collision.native_model import not_in_core
from optiplan.planners.base import Budget, Candidate, Failure, Planner, PlanResult, Progress, announce
from optiplan.planners.common.continuous_collision import Touch, first_contact
from optiplan.planners.common.failures import out_of_time, too_heavy
from optiplan.planners.common.goal_ranking import GoalSampler, goal_sampler
from optiplan.planners.common.moving_scene import among_moving
from optiplan.planners.common.path_timing import stopping, timed_path, within_torque
from optiplan.planners.common.stopwatch import Stopwatch
from optiplan.planners.sampling.constrained.seeds import ConstrainedSeeds
from optiplan.planners.sampling.ompl_search import ALTERNATE_RATIO, kpiece, rrt_connect
from optiplan.planners.sampling.sample_path import SampledPath, SamplingOptions, sample_path
from optiplan.planners.sampling.search import Searcher
from optiplan.planners.sampling.shortcutting import path_time
from optiplan.planners.sampling.shrunk_obstacles import through_thinner
from optiplan.planners.trajopt.among_moving import plan_among_moving
from optiplan.planners.trajopt.initial_guess import along_path, with_bump
from optiplan.planners.trajopt.look_ahead import AttemptOutcome, LookAhead
from optiplan.planners.trajopt.moving import plan_moving
from optiplan.planners.trajopt.optimizer import Attempt, Optimiser, attempt_record
from optiplan.planners.trajopt.options import TrajOptOptions
from optiplan.planners.trajopt.sqp import WORSE
from optiplan.planners.trajopt.stopping_rule import STATE, Patience, counted
from optiplan.planners.trajopt.terms.free_end import FreeEnd
from optiplan.planners.trajopt.terms.path_constraints import Broken, broken_constraint
from optiplan.planners.trajopt.through_vias import through_vias
from optiplan.planners.trajopt.warm import WarmStart
from optiplan.problem.problem import JointGoal, Problem
from optiplan.trajectory.timing.lower_bound import lower_bounds
from optiplan.trajectory.timing.stops import stop_at_corners
from optiplan.trajectory.trajectory import Trajectory

_EARLY = 1.0 / 3.0
"""Share of the budget after which straight lines that led to nothing must leave the rest to sampled paths."""

_QUICK = 0.15
"""Work, s, that a search may take that a late straight line waits for: for a first motion, not for a hard problem."""

_CLOSE = 0.2
"""Share of the option's margin that the best motion is optimised with once more: the margin is a wish."""

_WORTH_CLOSE = 0.01
"""Share of the cost to the bound below which no margin is in the way."""

_NO_GAIN = 1e-6
"""Share of the cost below which a motion counts as no better."""

_SEARCH, _FIRST_SEARCH = 0.5, 0.8
"""Share of what is left of the budget that one search for a path may take; while there is no motion at all."""

_SHORTER = 0.95
"""Share of its cost to which shortcuts must bring a path on an optimised curve to be optimised again."""

_END_STEPS = 40
"""Steps of the attempt with a free end, at most: it begins at a curve that is optimised already."""

_DENSE = 300
"""Waypoints on a curve whose chords are proved free in its place."""

Kind = Literal["straight", "line", "sampled", "relaxed", "bump", "close", "finer", "end"]


class TrajOpt(Planner[TrajOptOptions]):
    """Minimum-time B-splines by sequential quadratic programming, from straight lines and sampled paths.

    Everything that is proved free on the way is a candidate: straight lines timed exactly, sampled paths timed, every
    optimised curve; the best of them is the answer. Attempts go on while they can be expected to gain (`Patience`),
    in turn from a path sampled anew, from a straight line with a bump and from the best curve with a bump; in the end
    the best curve is optimised once more with twice the spans. Vias: see `through_vias`.
    """

    Options = TrajOptOptions

    passes_vias = True
    holds_constraints = True
    end_derivatives = 2
    times_obstacles = True

    def plan(self, problem: Problem, budget: Budget, progress: Progress) -> PlanResult:
        """Plan within the budget; see `planners.base.Planner`."""
        if problem.scene.moving:
            alone = among_moving if problem.vias else plan_among_moving
            return alone(self, problem, budget, progress)
        if problem.vias:
            return through_vias(self, problem, budget, progress)
        if problem.moving:
            return plan_moving(self, problem, budget, progress)
        return _Run(problem, budget, progress, self.options).result()

    def replan(self, problem: Problem, earlier: Trajectory, budget: Budget, progress: Progress) -> PlanResult:
        """Plan from an earlier motion; look for another way where that leads to nothing as good. See `warm`."""
        if problem.vias or problem.scene.moving:
            return self.plan(problem, budget, progress)
        warm = WarmStart(problem, earlier, self.options, budget, progress)
        if warm.good or (warm.best is not None and budget.over):
            return warm.result()
        return warm.with_search(self.plan(problem, budget, progress))


class _Run:
    """State of one call: timed stages, the best motions so far, the failure."""

    def __init__(self, problem: Problem, budget: Budget, progress: Progress, options: TrajOptOptions) -> None:
        self.problem, self.budget, self.progress, self.options = problem, budget, progress, options
        self.began = time.perf_counter()
        self.watch = Stopwatch()
        self.info: dict[str, Any] = {"attempts": [], "cut_short": False}
        self.candidates: list[Candidate] = []
        self.best = np.inf  # cost of the best candidate
        self.curve: Attempt | None = None  # the best optimised one
        self.searched_in_vain = False  # whether a search ended without a path
        self.direct = True  # whether straight lines, with or without a bump, are still tried
        self.repaired: tuple[Attempt, float] | None = None  # what the last path lies on, and that path's cost, s
        self.quick: SampledPath | None = None  # found while a line was being optimised, not optimised itself yet
        self.searches = 0  # for paths, begun
        self.touching: tuple[Touch, Trajectory] | None = None
        self.breaking: tuple[Broken, Trajectory] | None = None
        self.bound = self.soonest = 0.0  # on costs, and on durations, s
        self.patience = Patience(budget, options.good_enough)
        with self.watch.stage("set-up"):
            self.model = kept_planning_model(problem.robot, problem.scene)
            self.info.update(not_in_core(self.model))
            self.on_constraints = ConstrainedSeeds(problem, self.model)
            self.optimiser = Optimiser(problem, self.model, options)
        self.ahead = LookAhead(problem, options, budget)

    def result(self) -> PlanResult:
        """Search and return the best motion, or the failure."""
        try:
            failure = self._search()
        finally:
            self.ahead.close()
        if self.options.workers > 1:
            self.info["workers"] = {"count": self.options.workers, "attempts_of_threads": self.ahead.used}
        self._free_end()
        self._finer()
        self.info["cut_short"] |= self.budget.over
        if self.candidates:
            *earlier, last = self.candidates
            return PlanResult(last.trajectory, None, self.watch.seconds, self.info, tuple(earlier), last.seconds)
        if self.budget.cancelled:
            failure = out_of_time(self.budget, "looking for a trajectory")
        return PlanResult(None, failure, self.watch.seconds, self.info)

    def _search(self) -> Failure | None:
        problem, start = self.problem, self.problem.start
        with self.watch.stage("goals"):
            sampler = goal_sampler(problem, self.model, self.budget)
        if isinstance(sampler, Failure):
            return sampler
        goals = [q for q in sampler.configurations if self.optimiser.constraints.end_holds(q)]
        if not goals:
            return self.optimiser.constraints.no_end(sampler.configurations)
        bounds = lower_bounds(start, np.array(goals), problem.limits)
        if bounds[0] == 0.0:
            self._offer(stop_at_corners(np.array([start, goals[0]]), problem.limits, problem.robot.joint_names), None)
            return None
        self.bound, self.soonest = self._cost_bound(float(bounds[0])), float(bounds[0])
        early = self.budget.share(_EARLY)
        tried = goals[: self.options.straight_goals]
        for k, (goal, bound) in enumerate(zip(tried, bounds, strict=False)):
            if early.over or self._cost_bound(float(bound)) >= self.best or not self._worth():
                break
            if len(tried) > 1:
                lines = (self._along(np.array([start, other])) for other in tried[k:])
                self.ahead.expect(lines, self.best, self.searched_in_vain)
            self._straight(np.array([start, goal]))
            if self._worth():
                within = self.budget if self.candidates else early
                self._attempt("straight", self._along(np.array([start, goal])), within, lambda: self._quick(sampler))
        self.info["cut_short"] = early.over and not self.candidates
        return self._further(sampler)

    def _further(self, sampler: GoalSampler) -> Failure | None:
        """Try sampled paths, lines with a bump and the best curve with a bump in turn, while `Patience` allows.

        Lines are skipped once one of them has failed, until a search has failed too.
        """
        failure: Failure | None = None
        rng = np.random.default_rng(self.problem.seed)
        for number in range(self.options.seeds):
            if not self._worth():
                break
            self.ahead.expect(self._coming(sampler, number, rng), self.best, self.searched_in_vain)
            path = self.quick or self._sample(sampler, self._most(), through_thinner(self._repaired))
            self.quick = None
            if isinstance(path, Failure):
                failure = path
                self.direct = self.searched_in_vain = True
                self.patience.record(None)
            elif len(path.waypoints) > 2 or self.curve is None:
                failure = self._sampled(path) or failure
            if self.direct and self._worth():
                self.ahead.expect(self._coming(sampler, number, rng), self.best, self.searched_in_vain)
                self._attempt("line", self._with_bump(self._line(sampler, number), rng), self.budget)
            if self.curve is not None and self._worth():
                self.ahead.expect(self._coming(sampler, number, rng, line=False), self.best, self.searched_in_vain)
                self._attempt("bump", self._with_bump(self.curve.control, rng), self.budget)
        if self.candidates:
            return None
        return failure if failure is not None else self._why_not()

    def _coming(
        self, sampler: GoalSampler, number: int, rng: np.random.Generator, line: bool = True
    ) -> Iterator[Array]:
        """Yield the curves with a bump that attempts begin with from round `number` on, should none of them gain."""
        rng = deepcopy(rng)
        for k in count(number) if self.direct or self.curve is not None else ():
            if self.direct and (line or k > number):
                yield self._with_bump(self._line(sampler, k), rng)
            if self.curve is not None:
                yield self._with_bump(self.curve.control, rng)

    def _line(self, sampler: GoalSampler, number: int) -> Array:
        """Return control points (K, n) of the straight line to one promising goal, a different one for each number."""
        goals = self._promising(sampler)
        return self._along(np.array([self.problem.start, goals[number % len(goals)]]))

    def _with_bump(self, control: Array, rng: np.random.Generator) -> Array:
        """Return a curve with a bump."""
        limits = self.problem.limits
        duration = self.optimiser.basis.shortest_duration(control, limits.rates)
        return with_bump(self.optimiser.basis, control, duration, limits, rng)

    def _sampled(self, path: SampledPath) -> Failure | None:
        """Time a sampled path where that may be the best motion, and optimise from it.

        A path that lies on an optimised curve already, and that no shortcut has made shorter, is not optimised again;
        one that takes far longer than the best motion even at full speed is left.
        """
        failure = None
        if not self.candidates:
            failure = self._time_path(path) if self.on_constraints.apply else self._stopping(path)
        repaired, self.repaired = self.repaired, None
        if repaired is not None and path.cost > _SHORTER * repaired[1]:
            self._keep(repaired[0])
        elif self._cost_bound(path.cost) > WORSE * self.best:
            self.patience.record(None)
        else:
            self._attempt("sampled", self._along(path.waypoints), self.budget)
        if self.best > self._cost_bound(path.cost):
            self._time_path(path)
        return failure

    def _promising(self, sampler: GoalSampler) -> list[Array]:
        """Return the goals whose lower bound is below the best motion, soonest first."""
        goals = [q for q in sampler.configurations if self.optimiser.constraints.end_holds(q)]
        bounds = lower_bounds(self.problem.start, np.array(goals), self.problem.limits)
        costs = [self._cost_bound(float(bound)) for bound in bounds]
        return [q for q, cost in zip(goals, costs, strict=True) if cost < self.best]

    def _quick(self, sampler: GoalSampler) -> None:
        """Look for a path at once while there is no motion, and offer it with a stop at every corner."""
        if self.candidates or self.searches or self.on_constraints.apply:
            return
        path = self._sample(sampler, self.patience.seconds + _QUICK, None)
        if isinstance(path, SampledPath):
            self.quick = path
            self._stopping(path)

    def _most(self) -> float:
        """Return the work, s, at which searches end: where they stop being worth it, once there is a motion."""
        return self.patience.seconds + (self.patience.worth(self.best, self.bound) if self.candidates else np.inf)

    def _sample(self, sampler: GoalSampler, most: float, relaxed: Searcher | None) -> SampledPath | Failure:
        """Return a path of the next seed to any of the promising goals, sampled within `most` of work in all, s."""
        self.repaired, number = None, self.searches
        self.searches += 1
        share = _SEARCH if self.candidates else _FIRST_SEARCH
        budget = self.budget.leaving((1.0 - share) * self.budget.remaining)
        with self.watch.stage("sampling"):
            if self.on_constraints.apply:
                return self.on_constraints.path(self._promising(sampler), budget, number)
            options = SamplingOptions(
                budget,
                seed=self.problem.seed + 1000 * number,
                searcher=counted(rrt_connect, self.patience, most),
                alternate=counted(kpiece, self.patience, most, STATE / ALTERNATE_RATIO),
                relaxed=counted(relaxed, self.patience, most, STATE / ALTERNATE_RATIO) if relaxed else None,
                more_goals=sampler.more,
            )
            path = sample_path(self.model, self.problem.start, self._promising(sampler), self.problem.limits, options)
        self.info["cut_short"] |= isinstance(path, Failure) and budget.over
        return path

    def _repaired(self, waypoints: Array) -> Array | None:
        """Waypoints on the curve that a path which touches is optimised to, if it is free."""
        attempt = self._optimised("relaxed", self._along(waypoints), self.budget, None)
        if attempt is None:
            return None
        self._offer(attempt.trajectory, attempt)
        dense = self.optimiser.basis.at(np.linspace(0.0, 1.0, _DENSE)) @ attempt.control
        dense[0], dense[-1] = waypoints[0], waypoints[-1]
        self.repaired = attempt, float(path_time(dense, self.problem.limits.velocity).sum())
        return dense

    def _straight(self, ends: Array) -> None:
        """Offer the straight line between ends (2, n), timed exactly, if it is free."""
        with self.watch.stage("straight line"):
            problem = self.problem
            line = stop_at_corners(ends, problem.limits, problem.robot.joint_names)
            timed = within_torque(problem.robot, problem.limits, line)
            if timed is not None and first_contact(self.model, timed, lambda: self.budget.over) is None:
                self._offer(timed, None)

    def _stopping(self, path: SampledPath) -> Failure | None:
        """Offer the motion along the sampled path that stops at every corner: the first to be had of a path."""
        if self.on_constraints.apply:  # whose paths have too many corners
            return self._time_path(path)
        with self.watch.stage("timing of sampled paths"):
            timed = stopping(self.problem.robot, self.problem.limits, path.waypoints)
        if timed is None:
            return too_heavy(self.problem.robot, self.problem.limits, path.waypoints)
        if self._offer(timed, None):
            self.info["fallback"] = "sampled path"
        return None

    def _time_path(self, path: SampledPath) -> Failure | None:
        """Time the sampled path without optimising it."""
        with self.watch.stage("timing of sampled paths"):
            timed = self.on_constraints.motion(path, self.optimiser.constraints, self.budget)
            if timed is None:
                timed = timed_path(self.model, path.waypoints, self.problem.limits, self.budget)
        if isinstance(timed, Failure):
            return timed
        if timed is None:
            return too_heavy(self.problem.robot, self.problem.limits, path.waypoints)
        if self._offer(timed, None):
            self.info["fallback"] = "sampled path"
        return None

    def _along(self, waypoints: Array) -> Array:
        return along_path(self.optimiser.basis, waypoints, self.problem.limits.velocity)

    def _attempt(self, kind: Kind, control: Array, budget: Budget, late: Callable[[], None] | None = None) -> None:
        """Optimise from a seed, and keep what comes of it; `late` as in `Optimiser.run`."""
        attempt = self._optimised(kind, control, budget, None, late)
        if kind in ("straight", "line"):
            self.direct = attempt is not None
        self._keep(attempt)

    def _keep(self, attempt: Attempt | None) -> None:
        """Keep the result of an attempt; if it is the best so far, optimise it again with a smaller margin."""
        if attempt is not None:
            self._offer(attempt.trajectory, attempt)
            best = attempt.trajectory is self.candidates[-1].trajectory
            self.curve = attempt if best else self.curve
            if best and attempt.close and self.bound < (1.0 - _WORTH_CLOSE) * self.best:
                closer = self._optimised("close", attempt.control, self.budget, _CLOSE * self.options.margin)
                if closer is not None:
                    self._offer(closer.trajectory, closer)
        cost = None if attempt is None else self.optimiser.objective.cost(attempt.trajectory)
        self.patience.record(cost)

    def _free_end(self) -> None:
        """Optimise the best curve once more with its end free in the goal that it is in, where that may gain."""
        curve = self.curve
        if curve is None or self.budget.over or self.best <= self.options.good_enough * self.bound:
            return
        fixed, poses = self.optimiser, [goal for goal in self.problem.goal if not isinstance(goal, JointGoal)]
        ends = [end for end in (FreeEnd(self.problem, goal) for goal in poses) if end.holds(curve.control[-1])]
        if ends:
            few = replace(self.options, iterations=min(_END_STEPS, self.options.iterations))
            self.optimiser = Optimiser(self.problem, self.model, few, ends[0])
            margin = _CLOSE * self.options.margin if curve.close else None
            freed = self._optimised("end", curve.control, self.budget, margin)
            self.optimiser = fixed
            if freed is not None:
                self._offer(freed.trajectory, freed)

    def _finer(self) -> None:
        """Optimise the best curve once more with twice the spans, where it is the best motion and not at its bound."""
        curve, options = self.curve, self.options
        if curve is None or curve.trajectory is not self.candidates[-1].trajectory or self.budget.over:
            return
        if self.best <= options.good_enough * self.bound:
            return
        instants = np.linspace(0.0, 1.0, _DENSE)
        points = self.optimiser.basis.at(instants) @ curve.control
        self.optimiser = Optimiser(self.problem, self.model, replace(options, spans=2 * options.spans))
        margin = _CLOSE * options.margin if curve.close else None
        finer = self._optimised("finer", self.optimiser.basis.fit(instants, points), self.budget, margin)
        if finer is not None:
            self._offer(finer.trajectory, finer)

    def _optimised(
        self,
        kind: Kind,
        control: Array,
        budget: Budget,
        margin: float | None,
        late: Callable[[], None] | None = None,
    ) -> Attempt | None:
        """Return the optimised motion of an initial guess, if it is free."""
        self.progress("optimisation", 1.0 - self.budget.remaining / self.budget.seconds)
        with self.watch.stage("optimisation"):
            known = None
            if kind in ("straight", "line", "bump"):
                known = self.ahead.take(control, budget, self.best, self.searched_in_vain)
            attempt, steps = self._run(control, budget, margin, late) if known is None else self._made(known, late)
        self.patience.work(steps=steps)
        log = self.optimiser.log if known is None else known.log
        self.info["attempts"].append(attempt_record(kind, attempt, steps, log))
        if attempt is not None and attempt.touches:
            self.touching = attempt.touches[0], attempt.trajectory
        if attempt is not None and attempt.broken:
            self.breaking = attempt.broken[0], attempt.trajectory
        return attempt if attempt is not None and attempt.free else None

    def _run(
        self, control: Array, budget: Budget, margin: float | None, late: Callable[[], None] | None
    ) -> tuple[Attempt | None, int]:
        """Return the attempt from an initial guess, and its steps."""
        before = self.optimiser.steps
        attempt = self.optimiser.run(
            control, budget, margin, self.best, patient=self.searched_in_vain, first=self._offer_first, late=late
        )
        return attempt, self.optimiser.steps - before

    def _made(self, outcome: AttemptOutcome, late: Callable[[], None] | None) -> tuple[Attempt | None, int]:
        """Return an attempt that another thread has made, and its steps."""
        if outcome.late and late is not None:
            late()
        if outcome.first is not None:
            self._offer_first(outcome.first)
        return outcome.attempt, outcome.steps

    def _offer_first(self, attempt: Attempt) -> None:
        """Keep a curve that is free but not short yet while there is no other curve."""
        if self.curve is None:
            self._offer(attempt.trajectory, attempt)

    def _offer(self, trajectory: Trajectory, attempt: Attempt | None) -> bool:
        """Keep a free motion if it is better than the best and holds all path constraints; return whether it is."""
        if attempt is None:
            trajectory = self.optimiser.constraints.slowed(trajectory)
        cost = self.optimiser.objective.cost(trajectory)
        if cost >= self.best * (1.0 - _NO_GAIN):
            return False
        if attempt is None and self.optimiser.constraints.broken(trajectory):
            return False
        self.best = cost
        self.info.pop("fallback", None)
        self.candidates.append(Candidate(trajectory, time.perf_counter() - self.began))
        announce(self.progress, trajectory, self.soonest)
        if attempt is not None:
            self.curve = attempt
        return True

    def _cost_bound(self, duration: float) -> float:
        """Return a lower bound on the cost of motions of at least this duration, s."""
        return self.problem.objective.time * duration

    def _worth(self) -> bool:
        """Return whether the budget and `Patience` allow another attempt."""
        if self.budget.over:
            return False
        return not self.candidates or self.patience.worth_another(self.best, self.bound)

    def _why_not(self) -> Failure:
        detail = f"no free trajectory within {self.budget.seconds:.3g} s"
        if self.breaking is not None:
            return broken_constraint(*self.breaking, detail)
        if self.touching is None:
            return Failure("budget", detail)
        touch, motion = self.touching
        pair = touch.contact.pair
        detail += f"; the best attempt touches: '{pair.name_a}' and '{pair.name_b}' at t = {touch.t:.3f} s"
        return Failure("collision", detail, touch.witness(motion))
