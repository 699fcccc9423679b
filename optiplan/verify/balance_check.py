"""The robot does not tip over at any time, proved from the wrench at its base and a bound on its curvature."""

from weakref import WeakKeyDictionary

import numpy as np

from optiplan.arrays import Array, Flags, Index
from optiplan.problem.constraints.balance import TipOver
from optiplan.problem.problem import Problem
from optiplan.robot.batched.base_reaction import HOLDING, base_reaction, held_robot
from optiplan.robot.robot import Robot
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.continuous.intervals import derivative_bounds
from optiplan.verify.continuous.torque_bounds import TorqueBounds
from optiplan.verify.halving import TimeParts
from optiplan.verify.joint_constraint_check import of_the_motion, part_of, title
from optiplan.verify.report import Check, VerifyPolicy
from optiplan.verify.tolerances import POSITION_ROUNDING, TORQUE_ROUNDING

_FIRST, _MOST_FIRST = 0.01, 20_000  # s, intervals to begin with, and about how many at most
_PARTS = 4  # into which an open interval is divided

_bounds: WeakKeyDictionary[Robot, TorqueBounds] = WeakKeyDictionary()


class _BaseBounds:
    """Bounds on the wrench at the base of a robot, from `TorqueBounds` of the `HeldRobot`."""

    def __init__(self, robot: Robot) -> None:
        if robot not in _bounds:
            _bounds[robot] = TorqueBounds(*held_robot(robot))
        self._of = _bounds[robot]

    def over(self, motion: Array) -> tuple[Array, Array]:
        """Bounds on the sizes of force, N, and moment, N·m, and on their second derivatives: (K, 2) each.

        Args:
            motion: (5, K, n) as of `TorqueBounds.over`.
        """
        held = np.concatenate([np.zeros((*motion.shape[:2], HOLDING)), motion], axis=2)
        size, curvature = self._of.over(held)
        return size[:, [0, 3]], curvature[:, [0, 3]]


class _BalanceProof:
    """The rows g_i = R_i w of a motion, N·m: at times, and over intervals."""

    def __init__(self, robot: Robot, motion: Trajectory, one: TipOver) -> None:
        self._robot, self._motion, self._polygon = robot, motion, one.polygon
        self._bounds, self._rows = _BaseBounds(robot), one.polygon.rows(one.margin)
        self._lengths = np.stack([np.linalg.norm(self._rows[:, part], axis=1) for part in (slice(3), slice(3, 6))])
        mass = sum(body.mass for body in robot.model.inertias)
        self._weight = max(mass * float(np.linalg.norm(robot.model.gravity.linear)), 1e-9)
        self.evaluated, self.least, self.time = 0, np.inf, 0.0

    def proved(self, spans: TimeParts) -> Flags:
        """Return on which intervals all rows stay positive, (K,).

        A function with |f''| <= B is nowhere more than B w² / 8 below the chord between its ends.
        """
        ends = [self._at(spans.piece, spans.begin + share * spans.width) for share in (0.0, 1.0)]
        half = 0.5 * spans.width[:, None]
        c = self._motion.coefficients[spans.piece]
        size, curvature = self._bounds.over(derivative_bounds(c, spans.begin[:, None] + half, half, 5))
        room = np.minimum(*ends) - TORQUE_ROUNDING * size @ self._lengths
        sagitta = spans.width[:, None] ** 2 / 8.0 * (curvature @ self._lengths)
        return np.asarray((sagitta <= room).all(axis=1))

    def _at(self, piece: Index, local: Array) -> Array:
        """Return the rows (K, k) at times `local` (K,) of pieces; the least margin and its time are kept."""
        wrench = base_reaction(self._robot, *self._motion.states_in(piece, local))
        rows, margins = wrench @ self._rows.T, self._polygon.margins(wrench)
        lifted = np.isneginf(margins)  # there is no zero-moment point, and some row is negative
        margins[lifted] = rows[lifted].min(axis=1) / self._weight
        self.evaluated += len(wrench)
        k = int(np.argmin(np.where(np.isnan(margins), -np.inf, margins)))
        if not margins[k] >= self.least:
            self.least, self.time = float(margins[k]), float(self._motion.breakpoints[piece[k]] + local[k])
        return np.asarray(rows)


def tip_over(problem: Problem, trajectory: Trajectory, policy: VerifyPolicy, one: TipOver) -> Check:
    """Check that the zero-moment point stays inside the support by the margin.

    Each edge of the polygon has a row R_i w that is linear in the wrench w at the base. It stays positive on an
    interval of a piece if its values at the ends exceed width² / 8 times a bound on its second derivative; where they
    do not, the interval is divided. The value reported is the least margin met, m; where the ground would have to pull,
    it is the least row over the weight. The robot carries the masses of attached objects where these are stated, and of
    a task what it holds at each time; an object without a mass weighs nothing.

    Holds at: all times, rounding included.
    """
    name, robot = title(one), problem.robot
    if trouble := _trouble(robot, one):
        return Check(name, "continuous", False, limit=one.margin, unit="m", place="base", detail=trouble)
    part, begin = part_of(trajectory, one.during)
    proof = _BalanceProof(robot, part, one)
    spans, reason = TimeParts.of(part, _FIRST, _MOST_FIRST), ""
    while len(spans.piece) and not reason:
        held = proof.proved(spans)
        if not proof.least >= one.margin - POSITION_ROUNDING:
            reason = "beyond its limit" if not np.isnan(proof.least) else "not proved: numbers overflow"
        elif not held.all() and spans.width[~held].min() < _PARTS * policy.min_interval:
            reason = f"not proved on intervals of {policy.min_interval:g} s"
        elif proof.evaluated > policy.max_queries:
            reason = f"not proved with {policy.max_queries} wrenches"
        else:
            spans = spans.divided(~held, _PARTS)
    words = f"{reason or 'proved at all times'}: {proof.evaluated} wrenches{of_the_motion(one)}"
    when = begin + proof.time
    worst = proof.least if np.isfinite(proof.least) else None
    witness = {"q": trajectory(when).tolist()}
    return Check(name, "continuous", not reason, worst, one.margin, "m", when, "base", words, witness)


def _trouble(robot: Robot, one: TipOver) -> str:
    """Return why nothing can be proved of a statement; nothing where something can."""
    if not robot.has_inertia:
        return "the robot's file gives no masses"
    if not one.during[0] < one.during[1]:
        return "nothing of the motion is in its part"
    try:
        polygon = one.polygon
    except ValueError as error:
        return str(error)
    usable = 2.0 * polygon.area > one.margin * polygon.perimeter
    return "" if usable else f"a margin of {one.margin:g} m leaves nothing of the polygon"
