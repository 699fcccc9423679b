"""Steps of a task that are one smooth curve: a move, a line, or lines whose corners are rounded off."""

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from optiplan.arrays import Array
from optiplan.planners.task.planned_steps import PlannedMotion
from optiplan.records import dataclass
from optiplan.trajectory.joining import join_trajectories
from optiplan.trajectory.paths.hermite import hermite
from optiplan.trajectory.timing.path_constraints import ToolLimits
from optiplan.trajectory.trajectory import Trajectory

_SMOOTH = 1e-3
"""Largest share by which slope and curvature of two paths may differ where they meet smoothly."""


@dataclass(frozen=True, eq=False)
class SmoothRun:
    """One or more steps, and their curve.

    Attributes:
        steps: the steps.
        curve: of a move, its motion; of lines, their path, from 0.
        edges: (N steps + 1,) where each step begins and ends, as shares of the curve's parameter, from 0 to 1.
    """

    steps: tuple[PlannedMotion, ...]
    curve: Trajectory
    edges: tuple[float, ...] = (0.0, 1.0)

    @property
    def is_line(self) -> bool:
        """Whether `curve` is the path of lines, whose shape is fixed."""
        return self.steps[0].is_line

    def slow_parts(self) -> Iterator[tuple[float, float, ToolLimits]]:
        """Yield the parts of a path on which the speed of the tool is limited, as shares of its parameter."""
        for step, (begin, end) in zip(self.steps, pairwise(self.edges), strict=True):
            for limits in step.tool_limits:
                yield begin, end, limits


def smooth_runs(steps: Sequence[PlannedMotion]) -> list[SmoothRun]:
    """Return moves and lines as smooth curves; lines that meet in a rounded corner are one."""
    found: list[SmoothRun] = []
    for one in steps:
        if found and found[-1].is_line and one.is_line:
            found[-1] = _longer(found[-1], one)
        else:
            found.append(SmoothRun((one,), one.curve))
    return found


def is_rounded(before: PlannedMotion, after: PlannedMotion) -> bool:
    """Whether two lines meet in a rounded corner, with the same slope and curvature."""
    if before.corner is None:
        return False
    first, second = before.curve.scaled(before.corner.before.length), after.curve.scaled(before.corner.after.length)
    a, b = path_state(first, first.duration), path_state(second, 0.0)
    scale = np.maximum(np.abs(a).max(axis=1), np.abs(a[1]).max())
    return bool((np.abs(a - b).max(axis=1) <= _SMOOTH * scale).all())


def _longer(run: SmoothRun, after: PlannedMotion) -> SmoothRun:
    """Return a run with one line more, over the length of its lines, m."""
    corners = [step.corner for step in run.steps if step.corner is not None]
    first = run.curve.scaled(sum(corner.before.length for corner in corners))
    second = _beginning(after.curve.scaled(corners[-1].after.length), path_state(first, first.duration))
    length = first.duration + second.duration
    edges = tuple(edge * first.duration / length for edge in run.edges)
    return SmoothRun((*run.steps, after), join_trajectories([first, second]), (*edges, 1.0))


def path_state(path: Trajectory, at: float) -> Array:
    """Return value, slope and curvature of a path, (3, n)."""
    return np.array([path(at, order) for order in range(3)])


def _beginning(path: Trajectory, state: Array) -> Trajectory:
    """Return a path with exactly this state (3, n) at its beginning: the difference is rounding."""
    h = float(path.breakpoints[1])
    piece = hermite(state, path_state(path, h), np.array([h]))[0] / h ** np.arange(6)[:, None]
    coefficients = np.pad(path.coefficients, ((0, 0), (0, max(0, 6 - path.coefficients.shape[1])), (0, 0)))
    coefficients[0] = 0.0
    coefficients[0, :6] = piece
    return Trajectory(path.joint_names, path.breakpoints, coefficients)
