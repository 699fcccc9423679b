"""Time laws s(t) along a proved motion p(s), kept within the limits of joints by the native core.

With speed s' in [0, 1] of a law, the robot moves with

    q' = p' s',    q'' = p'' s'^2 + p' s'',    q''' = p''' s'^3 + 3 p'' s' s'' + p' s''',
    tau = M p' s'' + (M p'' + c(p, p')) s'^2 + g(p)

(Verscheure et al. 2009, Time-optimal path tracking for robots). A law is a chain of cubic polynomials. Each keeps the
limits of acceleration and jerk at all times by interval arithmetic on the ranges of p', p'' and p''' in short cells of
the path, and the torque limits by values and a bound on |tau''|.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from optiplan._core import core
from optiplan.arrays import Array
from optiplan.errors import OptiPlanError
from optiplan.robot.native_tree import native_tree
from optiplan.robot.robot import Limits, Robot
from optiplan.trajectory import polynomial
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.continuous.intervals import derivative_bounds
from optiplan.verify.continuous.torque import bounds_of
from optiplan.verify.report import VerifyPolicy

if TYPE_CHECKING:
    from optiplan._core._core_base import PathLaws as CoreLaws
    from optiplan._core._core_base import TimeLaw

SHORTEST_STEP, LONGEST_STEP, STEPS = 1e-3, 2e-3, 1000
"""s: pieces of a law, and cells of the path; as many as this where the bounds allow it."""

MOST_CELLS = 20_000
"""Cells of a path at most: those of long motions are wider than a step."""

LOOK = 4
"""Steps in whose intervals the way from each piece to a steady speed is checked."""

MOST_RATE, MOST_JERK = 50.0, 5e3
"""|s''|, 1/s, and |s'''|, 1/s²: bounds of a law where the path stands still, and no joint bounds it."""

LEVELS = np.array([0.02, 0.06, 0.2, 0.5, 1.0])
"""Shares of these bounds for which the curvature of torques is bounded in advance."""

RESERVES = (0.0, 0.02, 0.1)
"""Shares of the torque limits that searches leave to the proof, tried in this order."""


class PathPlace(NamedTuple):
    """Place on a path, speed and acceleration of the law there: s, s' and s''."""

    s: float
    speed: float
    acceleration: float


@dataclass(frozen=True, eq=False)
class SetPoint:
    """What a robot is to do at one time.

    Attributes:
        q, v, a: (n,), rad or m and s.
        torque: (n,), feed-forward of the rigid bodies, N·m or N.
        place: on the path.
    """

    q: Array
    v: Array
    a: Array
    torque: Array
    place: PathPlace


@dataclass(frozen=True, eq=False)
class Load:
    """The robot as it is loaded on a stretch of a motion, from `begin` to `end`, s."""

    begin: float
    end: float
    robot: Robot


class PathLaws:
    """Laws along a motion.

    Args:
        motion: verified with these limits and loads.
        limits: of the joints.
        loads: of all its stretches, in order.
        tolerance: share by which the motion's report lets these limits be passed.

    Attributes:
        overloaded: the first s at which gravity alone takes more torque than allowed; None where it nowhere does.

    Raises:
        OptiPlanError: the native core is not built.
    """

    def __init__(
        self,
        motion: Trajectory,
        limits: Limits,
        loads: Sequence[Load],
        tolerance: float = VerifyPolicy().limit_tolerance,
    ) -> None:
        if core is None:
            raise OptiPlanError("execution needs the native core of optiplan, which is not built: make core")
        self.motion = motion
        step = float(np.clip(motion.duration / STEPS, SHORTEST_STEP, LONGEST_STEP))
        share = 1.0 + tolerance
        rates = np.array([limits.acceleration * share, limits.jerk * share, limits.torque * share])
        self._core: CoreLaws = core.PathLaws.of(
            motion.breakpoints,
            motion.coefficients,
            rates,
            np.array([load.end for load in loads]),
            [native_tree(load.robot.model) for load in loads],
            max(step, motion.duration / MOST_CELLS),
            np.array([step, LOOK * step, MOST_RATE, MOST_JERK]),
        )
        if np.isfinite(rates[2]).any():
            bounds = _curvature(motion, loads, self._core.coarse_cells)
            self._core.set_curvature(bounds, LEVELS * MOST_RATE, LEVELS * MOST_JERK)
        overloaded = self._core.overloaded  # computed at each access
        self.overloaded = None if overloaded < 0.0 else overloaded

    def change(self, place: PathPlace, begin: float, target: float) -> "TimeLaw | None":
        """Return the law from a place at time `begin`, s, to a steady speed; None where it cannot begin there.

        Holds at: all times, for acceleration, jerk and torque; velocity is below that of the motion.
        """
        for reserve in RESERVES:
            law = self._core.change(*place, begin, target, reserve)
            if law is not None:
                return law
        return None

    def steady(self, s: float, speed: float, begin: float) -> "TimeLaw":
        """Return the law of a steady speed in [0, 1], which every verified motion admits."""
        return core.TimeLaw.steady(s, speed, begin)

    def set_point(self, law: "TimeLaw", t: float) -> SetPoint:
        """Return the set-point of a law at time t, s."""
        values, s, speed, acceleration = self._core.set_point(law, t)
        return SetPoint(values[0], values[1], values[2], values[3], PathPlace(s, speed, acceleration))


def _curvature(motion: Trajectory, loads: Sequence[Load], cells: int) -> Array:
    """Bounds on |tau''| in time, (levels, cells, n), of laws with |s''| <= c2 and |s'''| <= c3 of each level.

    |q^(k)| for k from 1 to 4 is at most |p'|, |p''| + |p'| c2, |p'''| + 3 |p''| c2 + |p'| c3, and
    |p''''| + 6 |p'''| c2 + 3 |p''| c2² + 4 |p''| c3.
    """
    edges: Array = motion.duration / cells * np.arange(cells + 1.0)
    q, first, second, third, fourth = _sizes(motion, edges)
    found = np.zeros((len(LEVELS), cells, motion.n))
    for k, (c2, c3) in enumerate(zip(LEVELS * MOST_RATE, LEVELS * MOST_JERK, strict=True)):
        jerk, snap = 3.0 * second * c2 + first * c3, 6.0 * third * c2 + 3.0 * second * c2**2 + 4.0 * second * c3
        rates = np.array([q, first, second + first * c2, third + jerk, fourth + snap])
        for load in loads:
            inside = (edges[1:] >= load.begin) & (edges[:-1] <= load.end)
            found[k, inside] = np.maximum(found[k, inside], bounds_of(load.robot).over(rates[:, inside])[1])
    return found


def _sizes(motion: Trajectory, edges: Array) -> Array:
    """Bounds on |p^(k)|, k from 0 to 4, between neighbouring edges (cells + 1,), s: (5, cells, n)."""
    piece_of = np.searchsorted(motion.breakpoints[1:-1], edges, side="right")
    size = np.zeros((5, len(edges) - 1, motion.n))
    for later in range(int(np.diff(piece_of).max(initial=0)) + 1):
        piece = np.minimum(piece_of[:-1] + later, piece_of[1:])
        begin, end = (
            np.maximum(edges[:-1], motion.breakpoints[piece]),
            np.minimum(edges[1:], motion.breakpoints[piece + 1]),
        )
        half = (np.maximum(0.5 * (end - begin), 0.0) * (1.0 + 1e-6))[:, None]
        middle = (0.5 * (begin + end) - motion.breakpoints[piece])[:, None]
        size = np.maximum(size, derivative_bounds(motion.coefficients[piece], middle, half, 5))
    return size


def reversed_motion(motion: Trajectory) -> Trajectory:
    """Return the same path from its end to its start: p(T - s)."""
    widths = motion.widths[::-1]
    moved = polynomial.shifted(motion.coefficients[::-1], widths)
    moved *= (-1.0) ** np.arange(moved.shape[1])[:, None]
    times = np.concatenate([[0.0], motion.duration - motion.breakpoints[-2::-1]])
    kept = np.diff(times) > 0.0  # rounding may leave nothing of the shortest pieces
    return Trajectory(motion.joint_names, np.append(times[:-1][kept], times[-1]), moved[kept])
