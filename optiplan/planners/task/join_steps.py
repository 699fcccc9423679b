"""Join moves and lines so that the arm does not stop between them.

A stretch of moves and lines without an event between them becomes one path. Lines keep their shape. Moves leave them
and arrive at them with the same direction and curvature. A free path is run in one go within all limits, and kept if
that is quicker than stopping.

The path is joined in a parameter p in which every joint moves at most at its speed limit for dp/dt = 1. Between a line
and a move, a polynomial of degree five replaces the part of the move next to the line. It matches position and two
derivatives at both of its ends. Between two moves both parts are replaced, and meet at the end of the first move.
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from optiplan.arrays import Array
from optiplan.libraries import loading
from optiplan.planners.base import Budget, Progress
from optiplan.planners.common.continuous_collision import first_contact
from optiplan.planners.common.tolerances import NO_MOTION, POSITION_LIMIT_ROUNDING
from optiplan.planners.task.planned_steps import Group, Pause, PlannedMotion, Stretch, TaskPart
from optiplan.planners.task.smooth_runs import SmoothRun, path_state, smooth_runs
from optiplan.planners.task.stops import why_stop
from optiplan.records import dataclass
from optiplan.trajectory.joining import cut_trajectory, join_trajectories
from optiplan.trajectory.paths.hermite import hermite_trajectory
from optiplan.trajectory.timing.compose import time_of
from optiplan.trajectory.timing.time_path import TimingOptions, time_path_by_law
from optiplan.trajectory.trajectory import Trajectory

_SHARES = (0.5, 0.25, 0.1)
"""Shares of a move's length that a junction replaces; if both ends take a half, the move is one polynomial."""

_ENOUGH = 0.05
"""Share of the time with stops: junctions of other sizes are tried until the gain is larger."""

_HOPELESS = 0.02
"""Share of the time with stops: a joined motion that is slower by more is not tried with other junctions."""

_POINTS = 40
"""Points of the spline that represents a move."""

_SAMPLES = 400
"""Samples of a motion, for its length."""

_TURNED = 0.1
"""Length of the sum of two unit directions below which moves turn back: there the arm stops anyway."""


def join_steps(parts: Sequence[TaskPart], budget: Budget, progress: Progress, thorough: bool = True) -> list[Group]:
    """Return the parts in groups between which the arm must stop; stretches are joined where that is quicker.

    Args:
        parts: steps, each from rest to rest.
        budget: stretches that are not joined when it is over stop.
        progress: called with the share of groups.
        thorough: whether junctions of other sizes are tried where the first free ones gain little.
    """
    groups = _stretches_and_pauses(parts)
    found: list[Group] = []
    for k, group in enumerate(groups):
        progress("joining steps", k / len(groups))
        if isinstance(group, list):
            group = [one for own in _joinable(group) for one in _joined(own, budget, thorough)]
        found.append(group)
    return found


def _stretches_and_pauses(parts: Sequence[TaskPart]) -> list[Group]:
    groups: list[Group] = []
    for part in parts:
        last = groups[-1] if groups else None
        if isinstance(part, Pause):
            groups.append(part)
        elif isinstance(last, list) and _can_continue(last[-1].steps[-1], part.steps[0]):
            last.append(part)
        else:
            groups.append([part])
    return groups


def _can_continue(before: PlannedMotion, after: PlannedMotion) -> bool:
    return why_stop(before, after) is None and not (_is_standstill(before) or _is_standstill(after))


def _is_standstill(motion: PlannedMotion) -> bool:
    """Whether a move ends where it begins: it has no direction to leave or to arrive in."""
    return bool(np.abs(motion.after.q - motion.before.q).max(initial=0.0) <= NO_MOTION)


def _joinable(group: list[Stretch]) -> list[list[Stretch]]:
    """Cut a group at moves with constraints: their curves must not change, and those of lines do not."""
    found: list[list[Stretch]] = []
    for stretch in group:
        if found and _keeps_constraints(found[-1][-1].steps[-1]) and _keeps_constraints(stretch.steps[0]):
            found[-1].append(stretch)
        else:
            found.append([stretch])
    return found


def _keeps_constraints(motion: PlannedMotion) -> bool:
    """Whether joining a motion with others cannot break its path constraints."""
    return motion.is_line or not motion.stage.problem.path_constraints


def _joined(group: list[Stretch], budget: Budget, thorough: bool) -> list[Stretch]:
    """Return a group as one stretch, or as several where some junction is not free, or not quicker."""
    if len(group) == 1 or budget.over:
        return group
    stopping = sum(stretch.duration for stretch in group)
    best: Stretch | None = None
    for first in range(len(_SHARES)):
        found = _in_one_go(group, first, budget)
        if found is not None and found.duration < (stopping if best is None else best.duration):
            best = found
        slow = found is not None and found.duration > (1.0 + _HOPELESS) * stopping
        gained = best is not None and best.duration < (1.0 - _ENOUGH) * stopping
        if budget.over or slow or gained or (found is not None and not thorough):
            break
    if best is not None:
        return [best]
    counts = np.cumsum([0, *(len(run.steps) for run in smooth_runs([stretch.steps[0] for stretch in group]))]).tolist()
    if len(counts) == 2:
        return group
    middle = counts[1] if len(counts) == 3 else counts[2]
    return [*_joined(group[:middle], budget, thorough), *_joined(group[middle:], budget, thorough)]


def _in_one_go(group: list[Stretch], first: int, budget: Budget) -> Stretch | None:
    """Return a group as one motion, with junctions of the first free size from `first` on; None where one is not."""
    runs = smooth_runs([stretch.steps[0] for stretch in group])
    sizes = [first] * (len(runs) - 1)
    while not budget.over and max(sizes, default=0) < len(_SHARES):
        path = _Path.of(runs, sizes)
        if path is None:
            return None
        touched = path.junction_that_touches(budget)
        if touched is None:
            return path.timed(budget)
        sizes[touched] += 1
    return None


@dataclass(frozen=True, eq=False)
class _PathElement:
    """A move or a line in the path, and its curve over the path's parameter."""

    run: SmoothRun
    curve: Trajectory

    @property
    def step(self) -> PlannedMotion:
        """Its first step."""
        return self.run.steps[0]

    def state(self, p: float) -> Array:
        """Return q, dq/dp, d²q/dp² (3, n)."""
        return path_state(self.curve, min(max(p, 0.0), self.length))

    @property
    def length(self) -> float:
        return self.curve.duration


@dataclass(frozen=True, eq=False)
class _Path:
    """A path through the elements of a group.

    Attributes:
        elements: moves and lines.
        parts: the curve of each, changed at its junctions; over parameters from 0.
    """

    elements: list[_PathElement]
    parts: list[Trajectory]

    @classmethod
    def of(cls, runs: Sequence[SmoothRun], sizes: Sequence[int]) -> "_Path | None":
        """Return the path with junctions of these sizes (indices of `_SHARES`); None where one turns back."""
        elements = [_element(run) for run in runs]
        parts = []
        for k, element in enumerate(elements):
            if element.step.is_line:
                parts.append(element.curve)
                continue
            begin, end = None, None
            cuts = [_SHARES[sizes[j]] if 0 <= j < len(sizes) else 0.0 for j in (k - 1, k)]
            if k > 0:
                begin = _meeting(elements[k - 1], element, cuts[0])
                if begin is None:
                    return None
            if k + 1 < len(elements):
                end = _meeting(element, elements[k + 1], cuts[1])
                if end is None:
                    return None
            parts.append(_between(element, (begin, end), (cuts[0], cuts[1])))
        return cls(elements, parts)

    def junction_that_touches(self, budget: Budget) -> int | None:
        """Return the junction next to the first place at which the path is not free or outside limits."""
        for k, (element, part) in enumerate(zip(self.elements, self.parts, strict=True)):
            if element.step.is_line:
                continue
            stage = element.step.stage
            limits = stage.problem.limits
            low, high = part.extrema(0)
            extrema = part.extrema_at(0)
            beyond = np.concatenate([limits.lower - low, high - limits.upper])
            where: float | None = None
            if beyond.max() > POSITION_LIMIT_ROUNDING:
                times = np.concatenate([extrema.t_low, extrema.t_high])
                where = float(times[int(np.argmax(beyond))])
            else:
                touch = first_contact(stage.model, part, lambda: budget.over)
                where = None if touch is None else touch.t
            if where is None:
                continue
            before = k - 1 if k > 0 else None
            after = k if k + 1 < len(self.elements) else None
            if before is None or after is None:
                return after if before is None else before
            return before if where < 0.5 * part.duration else after
        return None

    def timed(self, budget: Budget) -> Stretch | None:
        """Run along the path in one go."""
        edges = np.concatenate([[0.0], np.cumsum([part.duration for part in self.parts])])
        first = self.elements[0].step
        path = join_trajectories(self.parts)
        shares = edges / edges[-1]
        places = list(zip(self.elements, pairwise(shares.tolist()), strict=True))
        slow = [
            (low + begin * (high - low), low + end * (high - low), tool)
            for element, (low, high) in places
            for begin, end, tool in element.run.slow_parts()
        ]
        options = TimingOptions(tool_parts=tuple(slow), stop=lambda: budget.over)
        found = time_path_by_law(path, first.stage.problem.robot, first.stage.problem.limits, options)
        if found is None:
            return None
        motion, law = found
        ends = [low + edge * (high - low) for element, (low, high) in places for edge in element.run.edges[1:]]
        times = [time_of(law, share) for share in ends[:-1]]
        steps = tuple(one for element in self.elements for one in element.run.steps)
        return Stretch(steps, motion, (*times, motion.duration))


def _element(run: SmoothRun) -> _PathElement:
    """Return a run's curve over a parameter in which the fastest joint runs about at its speed limit."""
    curve, speed = run.curve, run.steps[0].stage.problem.limits.velocity
    t = np.linspace(0.0, curve.duration, _SAMPLES + 1)
    Q = curve(t)
    steps = np.linalg.norm(np.diff(Q, axis=0) / speed, axis=1)
    length = float(steps.sum())
    if run.is_line:
        return _PathElement(run, curve.scaled(max(length, 1e-6)))
    way = np.concatenate([[0.0], np.cumsum(steps)])
    kept = np.concatenate([[True], np.diff(way) > 1e-9 * max(length, 1e-9)])
    times = np.interp(np.linspace(0.0, length, _POINTS), way[kept], t[kept])
    points = curve(times)
    points[0], points[-1] = Q[0], Q[-1]
    return _PathElement(run, _cubic_spline(curve.joint_names, length, points))


def _cubic_spline(names: tuple[str, ...], length: float, points: Array) -> Trajectory:
    with loading():
        from scipy.interpolate import CubicSpline

    spline = CubicSpline(np.linspace(0.0, length, len(points)), points)
    return Trajectory(names, spline.x, np.swapaxes(spline.c[::-1], 0, 1))


def _meeting(before: _PathElement, after: _PathElement, share: float) -> Array | None:
    """Return the state (3, n) in which two elements meet: that of the line, or of two moves their mean direction."""
    if before.step.is_line:
        return before.state(before.length)
    if after.step.is_line:
        return after.state(0.0)
    a, b = before.state((1.0 - share) * before.length), after.state(share * after.length)
    speed = before.step.stage.problem.limits.velocity
    point = after.state(0.0)[0]
    ways = [(point - a[0]) / speed, (b[0] - point) / speed]
    if min(np.linalg.norm(way) for way in ways) == 0.0:
        return None
    direction = sum(way / np.linalg.norm(way) for way in ways)
    size = float(np.linalg.norm(direction))
    if size < _TURNED:
        return None
    return np.stack([point, speed * direction / size, np.zeros(len(point))])


def _between(element: _PathElement, meets: tuple[Array | None, Array | None], cuts: tuple[float, float]) -> Trajectory:
    """Return the curve of a move with the parts next to its junctions replaced, over a parameter from 0."""
    speed = element.step.stage.problem.limits.velocity
    names = element.curve.joint_names
    if meets[0] is not None and meets[1] is not None and sum(cuts) >= 1.0:
        return _gap(names, meets[0], meets[1], speed)
    begin, end = cuts[0] * element.length, (1.0 - cuts[1]) * element.length
    parts = [cut_trajectory(element.curve, begin, end)]
    if meets[0] is not None:
        parts.insert(0, _gap(names, meets[0], element.state(begin), speed))
    if meets[1] is not None:
        parts.append(_gap(names, element.state(end), meets[1], speed))
    return join_trajectories(parts)


def _gap(names: tuple[str, ...], a: Array, b: Array, speed: Array) -> Trajectory:
    """Return the polynomial of degree five between two states (3, n)."""
    width = max(float(np.linalg.norm((b[0] - a[0]) / speed)), 1e-6)
    return hermite_trajectory(names, np.array([0.0, width]), np.array([a, b]))
