"""Optimise curves with motion at their ends: the first and last three control points depend on the duration."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from optiplan.arrays import Array
from optiplan.planners.base import Budget
from optiplan.planners.trajopt.bspline_basis import DEGREE, SplineBasis
from optiplan.planners.trajopt.optimizer import ACTIVE, Attempt, Optimiser
from optiplan.planners.trajopt.program.iteration_log import NOTHING
from optiplan.planners.trajopt.program.sqp import MAX_VIOLATION, STUCK, Descended, Descender, DescentOptions
from optiplan.problem.problem import Problem, derived
from optiplan.records import dataclass
from optiplan.trajectory.state import State
from optiplan.trajectory.timing.time_scaling import speed_ratio
from optiplan.trajectory.timing.torque_scaling import RESERVE, torque_scale, torque_share
from optiplan.trajectory.trajectory import Trajectory

SETTLED = 5e-4
"""Largest relative difference of two successive durations at convergence."""

ROUNDS = 8
"""Largest number of descents, each with the ends of the last duration."""

EXACT = 1e-8
"""Relative excess of a limit that counts as rounding."""

LONGEST = 10.0
"""Multiple of the descent's duration beyond which a curve is given up: slower may mean a longer detour."""

STRETCHES = 12
"""Largest number of corrections of the duration until a curve keeps its limits."""


@dataclass(frozen=True, eq=False)
class EndStates:
    """The states at both ends of a curve q(u), t = u T."""

    start: State
    end: State

    def by_share(self, duration: float) -> tuple[Array, Array]:
        """Return q, dq/du = T v and d²q/du² = T² a at both ends of a curve of this duration, s: (3, n) each."""
        scale = duration ** np.arange(3)[:, None]
        first, last = (np.array([state.q, state.v, state.a]) * scale for state in (self.start, self.end))
        return first, last

    def powers(self, basis: SplineBasis) -> list[Array]:
        """Return the held control points as H0 + H1 T + H2 T² of the duration: (6, n) each."""
        states = np.array([[state.q, state.v, state.a] for state in (self.start, self.end)])
        return [basis.ends(*(states * power[None, :, None])) for power in np.eye(3)]

    def held(self, basis: SplineBasis, control: Array, duration: float) -> Array:
        """Return the control points (K, n) of the curve bent to its ends at this duration, s."""
        return basis.moved_ends(control, *self.by_share(duration))


def with_reserve(problem: Problem) -> Problem:
    """Return the problem with reduced torque limits: curves with moving ends cannot be slowed down afterwards."""
    return derived(problem, limits=replace(problem.limits, torque=(1.0 - 2.0 * RESERVE) * problem.limits.torque))


class NonzeroEndOptimiser:
    """Optimise curves between two states of motion, by the optimiser of curves between two configurations.

    With the ends of a duration T', the least duration is g(T'), the result of an ordinary program. A duration T is
    possible exactly where T >= g(T); the least one is the fixed point T = g(T). The iteration T_{k+1} = g(T_k) finds
    it: g changes by at most 2/3 of its argument, since the ends are a smaller part of a longer motion. Aitken's method
    extrapolates the iterates. At last the duration is corrected on the exact extrema of the curve with its own ends.
    """

    def __init__(self, problem: Problem, optimiser: Optimiser, ends: EndStates) -> None:
        self.problem, self.optimiser, self.ends = problem, optimiser, ends
        self.basis = optimiser.basis

    def along(self, motion: Trajectory) -> Array:
        """Return the control points (K, n) of the spline near a motion."""
        u = np.linspace(0.0, 1.0, 4 * self.basis.size)
        return self.basis.fit(u, motion(u * motion.duration), self.basis.ends(*self.ends.by_share(motion.duration)))

    def run(self, control: Array, duration: float, budget: Budget, margin: float | None = None) -> Attempt | None:
        """Optimise from control points (K, n) and a duration, s; check between the samples, add samples, repeat.

        None as of `Optimiser.run`.
        """
        own, options = self.optimiser, self.optimiser.options
        control = self.ends.held(self.basis, control, duration)
        descender = own.descender(control, margin, own.constraint_terms.begin(), duration)
        u = own.instants(control)
        attempt, own.taken, own.log = None, 0, NOTHING
        for _ in range(options.refinements + 1):
            descender.set_samples(u)
            found = self._fixed_point(descender, control, duration, lambda: budget.over)
            control, duration = found.control, found.duration
            if budget.cancelled or found.missing > MAX_VIOLATION:
                return None
            checked = own.checked(control, self.timed(control, duration), budget)
            if checked is None or budget.cancelled:
                return None
            attempt = replace(checked, close=found.nearest < ACTIVE)
            if attempt.free or own.taken >= options.iterations or budget.over or found.missing > STUCK:
                break
            u = own.more_instants(u, attempt)
        return attempt

    def _fixed_point(
        self, descender: Descender, control: Array, duration: float, stop: Callable[[], bool]
    ) -> Descended:
        """Optimise with the ends of the last duration until the duration converges."""
        own, most, times = self.optimiser, self.optimiser.options.iterations, [duration]
        for k in range(ROUNDS):
            control = self.ends.held(self.basis, control, times[-1])
            found = descender.optimise(control, DescentOptions(max(1, most - own.taken), stop))
            own.count(found)
            control = found.control
            settled = abs(found.duration - times[-1]) <= SETTLED * found.duration
            times.append(found.duration)
            if settled or stop() or own.taken >= most:
                break
            if k % 3 == 2:
                times.append(_extrapolated(*times[-3:]))
        return found

    def curve(self, control: Array, duration: float) -> Trajectory:
        """Return the curve with its ends at this duration, s."""
        points = self.ends.held(self.basis, control, duration)
        return Trajectory.from_bspline(self.problem.robot.joint_names, self.basis.knots * duration, points, DEGREE)

    def timed(self, control: Array, duration: float) -> Trajectory | None:
        """Return the cheapest curve of durations up to about this one within limits and torques; None without one."""
        problem, limits, T = self.problem, self.problem.limits, duration
        cost = self.optimiser.objective.cost
        best: Trajectory | None = None
        for _ in range(STRETCHES):
            curve = self.curve(control, T)
            speed, torque = speed_ratio(curve, limits), torque_ratio(problem, curve)
            good = max(speed, torque) <= 1.0 + EXACT and _inside(curve, limits.lower, limits.upper)
            if not np.isfinite(torque) or (best is not None and not good) or T > LONGEST * duration:
                break
            if good:
                best = curve if best is None else min(curve, best, key=cost)
                if speed >= 1.0 - SETTLED:
                    break
                T *= speed
            else:
                T *= max(speed, torque) * (1.0 + SETTLED)
        return best


def torque_ratio(problem: Problem, motion: Trajectory) -> float:
    """Return `torque_scale` of a motion, or 1 where it takes no more torque than its given ends.

    The states at the ends may be nearer to the limit than the reserve of the scale.
    """
    robot, limit = problem.robot, problem.limits.torque
    scale = torque_scale(robot, limit, motion)
    if scale <= 1.0:
        return scale
    at_ends = torque_share(robot, limit, motion, np.array([0.0, motion.duration]))
    within = at_ends <= 1.0 and torque_share(robot, limit, motion) <= max(at_ends, 1.0 - RESERVE) + EXACT
    return 1.0 if within else scale


def _inside(curve: Trajectory, lower: Array, upper: Array) -> bool:
    """Return whether the positions keep their limits, up to rounding."""
    low, high = curve.extrema(0)
    return bool((low >= lower - EXACT).all() and (high <= upper + EXACT).all())


def _extrapolated(a: float, b: float, c: float) -> float:
    """Return Aitken's limit of three successive values, at most two differences beyond the last."""
    curvature = (c - b) - (b - a)
    limit = c if curvature == 0.0 else c - (c - b) ** 2 / curvature
    return float(np.clip(limit, c - 2.0 * abs(c - b), c + 2.0 * abs(c - b)))
