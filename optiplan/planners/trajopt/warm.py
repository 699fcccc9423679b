"""Begin at an earlier motion: cut it where the robot is now, bend it to the new ends, optimise it in the new scene."""

from dataclasses import replace
from typing import Any

import numpy as np

from optiplan.arrays import Array
from optiplan.collision.kept_models import kept_planning_model
from optiplan.kinematics.ik.levenberg_marquardt import Descent
from optiplan.libraries import clock
from optiplan.planners.base import Budget, Candidate, PlanResult, Progress, announce
from optiplan.planners.common.continuous_collision import first_contact
from optiplan.planners.common.gravity import Gravity
from optiplan.planners.common.limit_violations import excess
from optiplan.planners.trajopt.bspline_basis import SplineBasis
from optiplan.planners.trajopt.initial_guess import with_bump
from optiplan.planners.trajopt.nonzero_end_optimiser import EndStates, NonzeroEndOptimiser, torque_ratio, with_reserve
from optiplan.planners.trajopt.optimise_in_time import TimedOptimiser
from optiplan.planners.trajopt.optimizer import Attempt, AttemptOptions, Optimiser, attempt_record
from optiplan.planners.trajopt.options import TrajOptOptions
from optiplan.problem.goals import turned
from optiplan.problem.goals_and_vias import AllOfGoal
from optiplan.problem.problem import GoalEnd, JointGoal, Problem, RegionGoal
from optiplan.problem.regions.together import sampler_of
from optiplan.trajectory.joining import cut_trajectory
from optiplan.trajectory.state import State
from optiplan.trajectory.timing.lower_bound import lower_bound
from optiplan.trajectory.trajectory import Trajectory

MOST_STEPS = 40
"""Largest number of steps from the earlier motion: beyond that, a search is the better use of the time."""

TRIED, TRIED_IN_TIME = ((0.2, 0), (1.0, 0)), ((1.0, 0), (1.0, 1), (1.0, 2), (1.0, 3), (1.0, 4))
"""Shares of the option's margin, and numbers of a bump, tried in turn: the earlier motion may be close to bodies.

Among bodies that move, a way around them is worth more: a short delay may be no way out.
"""

AS_GOOD = 1.1
"""New cost / expected cost up to which the search ends.

The expected cost is that of the rest of the earlier motion, plus the time to travel the shift of the ends.
"""

AT_BOUND = 1.01
"""Duration / lower bound up to which a motion that is still free is the answer unchanged."""

_SHARE = 0.9
"""Share of a pose goal's tolerances for its configuration."""

_SAMPLES, _ITERATIONS = 400, 60

_SAME = 1e-7
"""rad or m, and per second and second²: states nearer than this are one."""

_NEWTON = 5
"""Steps to the instant at which a motion passes the new start."""


class WarmStart:
    """A curve from an earlier motion.

    Attributes:
        ahead: the rest of the earlier motion, where it is an answer unchanged; None elsewhere.
        attempt: the free curve optimised from it; None without one.
        good: whether that is as good as the earlier motion was.
        info: as of an entry of `attempts` in a planner's `info`.
        seconds: taken.
    """

    def __init__(
        self,
        problem: Problem,
        earlier: Trajectory,
        options: TrajOptOptions,
        budget: Budget,
        progress: Progress,
        basis: SplineBasis | None = None,
    ) -> None:
        """Optimise the rest of an earlier motion, with the basis of the options or another one."""
        began = clock()
        self.problem, self.earlier, self.budget = problem, _ahead(problem, earlier), budget
        self.model = kept_planning_model(problem.robot, problem.scene, problem.tracking_error)
        self.in_time = bool(problem.scene.dynamic_obstacles)
        stated = with_reserve(problem) if problem.nonzero_ends or self.in_time else problem
        few = replace(options, iterations=min(MOST_STEPS, options.iterations))
        self.optimiser = Optimiser(stated, self.model, few, basis=basis)
        self.attempt: Attempt | None = None
        end = self._end()
        self.ahead = None if end is None or self.in_time or not self._still_good(end) else self.earlier
        self.good = end is not None and self.ahead is not None and self._at_bound(end)
        if end is not None and not self.good:
            progress("optimisation from the earlier motion", 0.0)
            for share, bump in TRIED_IN_TIME if self.in_time else TRIED:
                found = self._optimised(end, share * options.margin, bump)
                if found is not None and found.free:
                    self.attempt = found
                    break
        if self.attempt is not None and end is not None:
            announce(progress, self.attempt.trajectory)
            cost = problem.cost
            moved = np.abs([self.earlier.start - problem.start, self.earlier.end - end.q]) / problem.limits.velocity
            expected = cost(self.earlier) + problem.objective.time * float(moved.max(axis=1).sum())
            self.good = cost(self.attempt.trajectory) <= AS_GOOD * expected
        self.seconds = clock() - began
        self.info: dict[str, Any] = attempt_record("warm", self.attempt, self.optimiser.steps, self.optimiser.log)
        if self.attempt is None and self.ahead is not None and self.good:
            self.info = {"seed": "warm", "free": True, "iterations": 0, "duration": self.ahead.duration}

    @property
    def best(self) -> Trajectory | None:
        """Return the better of the curve and the rest of the earlier motion."""
        found = [] if self.attempt is None else [self.attempt.trajectory]
        found += [] if self.ahead is None else [self.ahead]
        return min(found, key=self.problem.cost, default=None)

    def result(self) -> PlanResult:
        """The best as an answer."""
        info = {"attempts": [self.info], "cut_short": self.budget.over}
        return PlanResult(self.best, None, {"from the earlier motion": self.seconds}, info, (), self.seconds)

    def with_search(self, found: PlanResult) -> PlanResult:
        """The better of that and what a search found after it."""
        info = {**found.info, "attempts": [self.info, *found.info.get("attempts", ())]}
        timings = {"from the earlier motion": self.seconds, **found.timings}
        every = list(found.earlier)
        if found.trajectory is not None:
            every.append(Candidate(found.trajectory, found.seconds or 0.0))
        every = [replace(one, seconds=one.seconds + self.seconds) for one in every]
        if self.best is not None:
            every.append(Candidate(self.best, self.seconds))
        if not every:
            return replace(found, info=info, timings=timings)
        *earlier, last = sorted(every, key=lambda one: self.problem.cost(one.trajectory), reverse=True)
        return PlanResult(last.trajectory, None, timings, info, tuple(earlier), last.seconds)

    def _optimised(self, end: State, margin: float, bump: int) -> Attempt | None:
        """Optimise the earlier motion, shifted by its start's shift and, increasingly, by its end's; or with a bump."""
        start, earlier, basis = self.problem.start_state, self.earlier, self.optimiser.basis
        u = np.linspace(0.0, 1.0, _SAMPLES)
        kind = TimedOptimiser if self.in_time else NonzeroEndOptimiser
        curves = kind(self.problem, self.optimiser, EndStates(start, end))
        points, done = earlier(u * earlier.duration), _progress(earlier, u, self.problem.limits.velocity)[:, None]
        points = points + (1.0 - done) * (start.q - earlier.start) + done * (end.q - earlier.end)
        ends = EndStates(replace(earlier.state(0.0), q=start.q), replace(earlier.state(earlier.duration), q=end.q))
        control = basis.fit(u, points, basis.ends(*ends.by_share(earlier.duration)))
        if bump:
            rng = np.random.default_rng([self.problem.seed, bump])
            control = with_bump(basis, control, earlier.duration, self.problem.limits, rng)
        if self.in_time or any(rate.any() for rate in (start.v, start.a, end.v, end.a)):
            return curves.run(control, earlier.duration, self.budget, margin)
        control = curves.ends.held(basis, control, earlier.duration)
        return self.optimiser.run(control, self.budget, AttemptOptions(margin))

    def _still_good(self, end: State) -> bool:
        """Return whether the rest of the earlier motion leads from the start to this end, free and within limits."""
        motion, limits = self.earlier, self.problem.limits
        here, there = motion.state(0.0), motion.state(motion.duration)
        same = [
            np.abs(getattr(found, rate) - getattr(stated, rate)).max() <= _SAME
            for found, stated in ((here, self.problem.start_state), (there, end))
            for rate in ("q", "v", "a")
        ]
        if not all(same) or first_contact(self.model, motion, lambda: self.budget.over) is not None:
            return False
        if excess(motion, limits) is not None or torque_ratio(self.problem, motion) > 1.0:
            return False
        return not self.optimiser.constraints.broken(motion)

    def _at_bound(self, end: State) -> bool:
        """Return whether the rest of the earlier motion is near the lower bound to this end."""
        problem = self.problem
        if problem.nonzero_ends or not problem.objective.only_time:
            return False
        return self.earlier.duration <= AT_BOUND * lower_bound(problem.start, end.q, problem.limits)

    def _end(self) -> State | None:
        """Return the state at the goal configuration nearest to the earlier end; None where none is free."""
        q0, speed = self.earlier.end, self.problem.limits.velocity
        ends = [q for goal in self.problem.goal if (q := self._configuration(goal, q0)) is not None]
        gravity = Gravity(self.problem.robot, self.problem.limits.torque)
        for q in sorted(ends, key=lambda q: float((np.abs(q - q0) / speed).max())):
            blocked = not self.in_time and self.model.collides(q)  # what moves may have passed by then
            if not blocked and not gravity.too_much(q):
                return self.problem.end_states(q)[0]
        return None

    def _configuration(self, goal: GoalEnd, near: Array) -> Array | None:
        if isinstance(goal, JointGoal):
            return turned(self.problem.robot, goal, near)[0]
        if isinstance(goal, RegionGoal | AllOfGoal):
            q, inside = sampler_of(self.problem.robot, goal).onto(near)
            return q if inside else None
        descent = Descent(self.problem.robot, goal.frame, goal.orientation < np.pi)
        descent.aim(goal.X_WG)
        return descent.settle(descent.inside(near), _SHARE * goal.position, _SHARE * goal.orientation, _ITERATIONS)


def _progress(motion: Trajectory, u: Array, speed: Array) -> Array:
    """Return the share (N,) of a motion's length travelled at shares u (N,) of its time; joints in units of speed."""
    pace = np.linalg.norm(motion(u * motion.duration, 1) / speed, axis=1)
    way = np.concatenate([[0.0], np.cumsum(0.5 * (pace[1:] + pace[:-1]) * np.diff(u))])
    return np.asarray(way / way[-1]) if way[-1] > 0.0 else u


def _ahead(problem: Problem, earlier: Trajectory) -> Trajectory:
    """Return the rest of a motion from its state nearest to the new start, in time.

    The velocity counts too: a robot at rest is nearest to where the motion rests.
    """
    t = np.linspace(0.0, earlier.duration, _SAMPLES)[:-1]
    state, limits = problem.start_state, problem.limits
    away = np.abs(earlier(t) - state.q) / limits.velocity + np.abs(earlier(t, 1) - state.v) / limits.acceleration
    here = float(t[int(np.argmin(away.max(axis=1)))])
    for _ in range(_NEWTON if state.v.any() else 0):
        v = earlier(here, 1)
        here += float((problem.start - earlier(here)) @ v) / max(float(v @ v), 1e-12)
        here = float(np.clip(here, 0.0, t[-1]))
    return cut_trajectory(earlier, here, earlier.duration)
