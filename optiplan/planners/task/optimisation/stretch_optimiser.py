"""Optimise a stretch of moves and lines as one program, from a motion that does it already."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from optiplan.arrays import Array
from optiplan.planners.base import Budget
from optiplan.planners.common.continuous_collision import contacts_along
from optiplan.planners.common.tolerances import POSITION_LIMIT_ROUNDING
from optiplan.planners.path_constraints.motion_check import PathConstraints
from optiplan.planners.task.optimisation.line_part import LinePart, SpeedLimit
from optiplan.planners.task.optimisation.move_part import MovePart
from optiplan.planners.task.optimisation.program import StretchProgram
from optiplan.planners.task.optimisation.transcription import Part, StretchCurve, StretchTranscription
from optiplan.planners.task.planned_steps import PlannedMotion, Stretch
from optiplan.planners.task.smooth_runs import SmoothRun, smooth_runs
from optiplan.planners.trajopt.bspline_basis import DEGREE, SplineBasis, moving_breakpoints
from optiplan.planners.trajopt.nonzero_end_optimiser import with_reserve
from optiplan.planners.trajopt.optimizer import Optimiser, around
from optiplan.planners.trajopt.options import TrajOptOptions
from optiplan.planners.trajopt.program.sqp import DescentOptions, PythonProgram, descend
from optiplan.robot.robot import Robot
from optiplan.trajectory.joining import cut_trajectory, join_trajectories
from optiplan.trajectory.paths.hermite import hermite
from optiplan.trajectory.timing.compose import time_of
from optiplan.trajectory.timing.path_constraints import tool_motion, tool_scale
from optiplan.trajectory.timing.time_scaling import scale_to_limits
from optiplan.trajectory.timing.torque_scaling import torque_scale
from optiplan.trajectory.trajectory import Trajectory

_STEPS, _ROUNDS = 40, 4
"""Steps of a descent, and rounds in which samples are added where bodies touch between them; at most."""

_SAMPLES = 200
"""Samples of a motion, to which the first curves are fitted."""

_GAIN = 1e-3
"""Share of the duration: least gain of another curve."""

_ON_PATH = 1e-7
"""rad or m: how far polynomials of degree five may be off the path of a line between their knots."""

_ALONG, _NO_TWIST = 50, 1e-9
"""Places of a line at which the tool's speed is limited; m or rad per unit of the path: a smaller twist is none."""

_KEPT, _AROUND = 0.01, 0.03
"""Shares of a path beyond a part with a limit of the tool's speed: the limit still holds, and doubles."""

_LEAST_SPAN = 1e-6
"""Share of its duration: least distance of two knots of a line."""

_KNOTS = 9
"""Times that the pieces of a line are halved for `_ON_PATH`, at most."""


def optimised(stretches: Sequence[Stretch], options: TrajOptOptions, budget: Budget) -> list[Stretch]:
    """Return the stretches optimised as one, where that is quicker; else unchanged."""
    runs = smooth_runs([one for stretch in stretches for one in stretch.steps])
    if len(runs) == 1:
        return list(stretches)
    steps: list[Trajectory] = []
    for stretch in stretches:
        steps += [cut_trajectory(stretch.motion, a, b) for a, b in pairwise((0.0, *stretch.ends))]
    counts = np.cumsum([0, *(len(run.steps) for run in runs)]).tolist()
    curves = [join_trajectories(steps[a:b]) for a, b in pairwise(counts)]
    found = StretchOptimiser(runs, curves, options).run(budget)
    return list(stretches) if found is None else [found]


class StretchOptimiser:
    """One stretch: its parts, and the motion to begin with.

    Attributes:
        runs: moves and lines.
        curves: the motion of each so far.
        duration: of all of them so far, s.
    """

    def __init__(self, runs: Sequence[SmoothRun], curves: Sequence[Trajectory], options: TrajOptOptions) -> None:
        self.runs, self.curves, self.options = tuple(runs), tuple(curves), options
        self.duration = sum(curve.duration for curve in curves)
        self.parts: list[Part] = []
        last = len(curves) - 1
        for k, (run, curve) in enumerate(zip(runs, curves, strict=True)):
            rests = k == 0, k == last
            self.parts.append(_line(run, rests) if run.is_line else self._move(run.steps[0], curve, rests))
        self.made = StretchTranscription(self.parts)

    def run(self, budget: Budget) -> Stretch | None:
        """Return the stretch in less time, free and within all limits; None where nothing is gained."""
        y = self._begin()
        program = PythonProgram(StretchProgram(self.made))
        for _ in range(_ROUNDS):
            y = descend(program, y, DescentOptions(_STEPS, lambda: budget.over)).control
            found = self._timed(y)
            if found is None or found.duration > (1.0 - _GAIN) * self.duration:
                return None
            if not self._touches(y, budget):
                return None if self._broken(found) else found
            if budget.over:
                break
        return None

    def _move(self, move: PlannedMotion, curve: Trajectory, rests: tuple[bool, bool]) -> MovePart:
        basis = SplineBasis(moving_breakpoints(self.options.spans, self.options.bunching, rests))
        own = Optimiser(with_reserve(move.stage.problem), move.stage.model, self.options, basis=basis)
        u = np.linspace(0.0, 1.0, _SAMPLES)
        control = own.basis.fit(u, curve(u * curve.duration))
        return MovePart(own, np.array([curve.start, curve.end]), own.instants(control))

    def _begin(self) -> Array:
        """Return the variables nearest to the motion so far."""
        made, T = self.made, self.duration
        y = np.zeros(made.size)
        w = np.linspace(0.0, 1.0, _SAMPLES)
        y[: len(self.parts)] = [curve.duration / T for curve in self.curves]
        for k, place in made.passing.items():
            state = self.curves[k].state(self.curves[k].duration)
            y[place] = np.concatenate([T * state.v, T**2 * state.a])
        for k, (part, curve) in enumerate(zip(self.parts, self.curves, strict=True)):
            if isinstance(part, LinePart):
                y[made.places[k]] = part.fitted(w, *_law(part.path, curve, w))
        for k, (part, curve) in enumerate(zip(self.parts, self.curves, strict=True)):
            if isinstance(part, MovePart):
                ends = made.curve(y, T).end_states(k)
                y[made.places[k]] = part.fitted(w, curve(w * curve.duration), *ends)
        y[: len(self.parts)] /= y[: len(self.parts)].sum()
        return y

    def _timed(self, y: Array) -> Stretch | None:
        """Return the stretch at the least duration within all limits, exactly; None where gravity is too much."""
        first = self.runs[0].steps[0].stage.problem
        robot, limits = first.robot, first.limits
        curve = self.made.curve(y, self.made.shortest_duration(y))
        motions = [self._motion(curve, k) for k in range(len(self.parts))]
        edges = np.concatenate([[0.0], np.cumsum([motion.duration for motion in motions])])
        whole = join_trajectories(motions)
        ends = self._ends(curve, edges)
        steps = tuple(one for run in self.runs for one in run.steps)
        slower = 0.0
        for one, begin, end in zip(steps, (0.0, *ends), ends, strict=False):
            for tool in one.tool_limits:
                slower = max(slower, tool_scale(robot, tool, cut_trajectory(whole, begin, end)))
        low, high = whole.extrema(0)
        beyond = np.maximum(limits.lower - low, high - limits.upper)
        if (beyond > POSITION_LIMIT_ROUNDING).any():
            return None
        fitted = scale_to_limits(whole, limits, slower)
        scale = torque_scale(robot, limits.torque, fitted)
        if not np.isfinite(scale):
            return None
        fitted = fitted.scaled(fitted.duration * scale)
        return Stretch(steps, fitted, tuple(fitted.duration / whole.duration * end for end in ends))

    def _ends(self, curve: StretchCurve, edges: Array) -> list[float]:
        """Return when each step ends, s: inside of a run where its law passes the edge."""
        found: list[float] = []
        for k, run in enumerate(self.runs):
            inner = run.edges[1:-1]
            if inner:
                law = self._spline(curve, k)
                found += [float(edges[k]) + time_of(law, edge) for edge in inner]
            found.append(float(edges[k + 1]))
        return found

    def _motion(self, curve: StretchCurve, k: int) -> Trajectory:
        part, motion = self.parts[k], self._spline(curve, k)
        return motion if isinstance(part, MovePart) else along(part.path, motion)

    def _spline(self, curve: StretchCurve, k: int) -> Trajectory:
        """Return the motion of a move, or the law of a line."""
        part = self.parts[k]
        names = self.curves[k].joint_names if isinstance(part, MovePart) else ("s",)
        return Trajectory.from_bspline(names, part.basis.knots * curve.seconds(k), curve.controls[k], DEGREE)

    def _touches(self, y: Array, budget: Budget) -> bool:
        """Whether a move touches anything; samples are added where it does."""
        found = False
        curve = self.made.curve(y, self.made.shortest_duration(y))
        for k, part in enumerate(self.parts):
            if isinstance(part, MovePart):
                touches = list(contacts_along(part.own.model, self._motion(curve, k), lambda: budget.cancelled))
                if touches:
                    u = part.instants.u
                    more = (around(u, touch.t / curve.seconds(k)) for touch in touches)
                    part.resample(np.concatenate([u, *more]))
                    found = True
        return found

    def _broken(self, stretch: Stretch) -> bool:
        for step, begin, end in zip(stretch.steps, (0.0, *stretch.ends), stretch.ends, strict=False):
            kept = PathConstraints(step.stage.problem)
            if kept.all and list(kept.broken(cut_trajectory(stretch.motion, begin, end))):
                return True
        return False


def _line(run: SmoothRun, rests: tuple[bool, bool]) -> LinePart:
    problem, path = run.steps[0].stage.problem, run.curve.scaled(1.0)
    slow = _slow(problem.robot, path, run)
    return LinePart(path, problem.robot, with_reserve(problem).limits, rests, slow, len(run.steps))


def _slow(robot: Robot, path: Trajectory, run: SmoothRun) -> SpeedLimit | None:
    """Return the limits of the tool's speed along a path (over [0, 1]); None without any.

    Beyond a limited part the limit rises linearly, so that the program sees it in advance.
    """
    s = np.unique(np.concatenate([np.linspace(0.0, 1.0, _ALONG * len(run.steps)), run.edges]))
    rate = np.full(len(s), np.inf)
    for begin, end, limits in run.slow_parts():
        inside = np.clip(s, begin, end)
        twist, _ = tool_motion(robot, limits.frame, [path(inside, order) for order in range(3)])
        ways = np.maximum(np.linalg.norm(twist.reshape(-1, 2, 3), axis=2), _NO_TWIST)
        own = np.minimum(limits.linear / ways[:, 0], limits.angular / ways[:, 1])
        rate = np.minimum(rate, own * (1.0 + np.maximum(np.abs(s - inside) - _KEPT, 0.0) / _AROUND))
    return SpeedLimit(s, rate) if np.isfinite(rate).all() else None


def along(path: Trajectory, law: Trajectory) -> Trajectory:
    """Return the motion p(s(t)) in polynomials of degree five, off it by `_ON_PATH` at most.

    They join exact states at knots that are halved until the path is kept; composed exactly, the degree would be the
    product of both.
    """
    crossed = np.interp(path.breakpoints[1:-1], *_rising(law))
    t = np.unique(np.concatenate([law.breakpoints, crossed[(crossed > 0.0) & (crossed < law.duration)]]))
    t = t[np.concatenate([[True], np.diff(t) > _LEAST_SPAN * law.duration])]
    t[-1] = law.duration
    for _ in range(_KNOTS):
        states, h = np.swapaxes(_states(path, law, t), 0, 1), np.diff(t)
        pieces = hermite(states[:-1], states[1:], h)
        middle = np.einsum("mkn,k->mn", pieces, 0.5 ** np.arange(6))
        off = np.abs(middle - _states(path, law, t[:-1] + 0.5 * h)[0]).max(axis=1) > _ON_PATH
        if not off.any():
            break
        t = np.sort(np.concatenate([t, (t[:-1] + 0.5 * h)[off]]))
    return Trajectory(path.joint_names, t, pieces / h[:, None, None] ** np.arange(6)[:, None])


def _states(path: Trajectory, law: Trajectory, t: Array) -> Array:
    """Return q, v and a on the path at times (N,): (3, N, n)."""
    s, v, a = (law(t, order) for order in range(3))
    p = [path(np.clip(s[:, 0], 0.0, path.duration), order) for order in range(3)]
    return np.array([p[0], p[1] * v, p[2] * v**2 + p[1] * a])


def _rising(law: Trajectory) -> tuple[Array, Array]:
    """Return samples of a law and their times."""
    t = np.linspace(0.0, law.duration, 20 * _SAMPLES)
    return law(t)[:, 0], t


def _law(path: Trajectory, motion: Trajectory, w: Array) -> tuple[Array, Array]:
    """Return s (N,) of a motion along a path at shares w (N,) of its time, and s, ds/dw, d²s/dw² at its ends, (2, 3).

    Both have travelled as far, so that s follows from the lengths; its derivatives at the ends are those along p'.
    """
    way = np.linspace(0.0, 1.0, 20 * _SAMPLES)
    length = _length(path(way))
    t = w * motion.duration
    s = np.interp(_length(motion(t)) / max(_length(motion(t))[-1], 1e-12) * length[-1], length, way)
    ends = np.zeros((2, 3))
    for i, at in enumerate((0.0, 1.0)):
        p1, p2 = path(at, 1), path(at, 2)
        v, a = (motion(at * motion.duration, order) for order in (1, 2))
        rate = float(p1 @ v / (p1 @ p1)) if p1.any() else 0.0
        rate_change = float(p1 @ (a - p2 * rate**2) / (p1 @ p1)) if p1.any() else 0.0
        ends[i] = at, rate * motion.duration, rate_change * motion.duration**2
    return s, ends


def _length(points: Array) -> Array:
    """Return the length (N,) of the path through points (N, n) up to each."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
