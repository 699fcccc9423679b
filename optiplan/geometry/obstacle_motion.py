"""Motion of an obstacle: its displacement is a polynomial of time, and so is the angle by which it turns."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array, ReadOnlyArrays
from optiplan.records import dataclass

SLIDES = 3
"""Rows of a motion that are metres; a fourth one is the angle."""


@dataclass(frozen=True, eq=False)
class ObstacleMotion(ReadOnlyArrays):
    """Motion M(t) = Trans(d(t)) Rot(axis through point, a(t)) of everything that moves as one; it ends at `until`.

    A point x is at a + R(a(t)) (x - a) + d(t) with a the point of the axis; d(t) = sum_k c_k t^k, and a(t) likewise.

    Attributes:
        coefficients: (3, k + 1), one row an axis of the world, in ascending powers of time, m/s^k; a fourth row is the
            angle, rad/s^k.
        until: s, the last instant of the motion; infinite: it never ends.
        axis: (3,) unit vector about which it turns, where there is a fourth row.
        point: (3,) of that axis, m, before the displacement.
    """

    coefficients: Array
    until: float = np.inf
    axis: Array | None = None
    point: Array | None = None

    @classmethod
    def of_data(
        cls,
        polynomial: Sequence[Sequence[float]] | None = None,
        until: float | None = None,
        turn: Mapping[str, Any] | None = None,
    ) -> "ObstacleMotion":
        """Return the motion of three rows of coefficients of any lengths, and of `axis`, `angle`, `about` of a turn."""
        rows = [list(row) for row in polynomial or [[0.0]] * SLIDES]
        axis = point = None
        if turn is not None:
            rows.append(list(turn["angle"]))
            axis = np.array(turn["axis"], float)
            axis = np.ldexp(axis, -np.frexp(np.abs(axis).max())[1])  # exact; lengths of any size are numbers then
            axis /= math.hypot(*axis)
            point = np.array(turn["about"], float)
        size = max(1, *(len(row) for row in rows))
        padded = [[*row, *[0.0] * (size - len(row))] for row in rows]
        coefficients = np.array(padded, float)
        return cls(coefficients, np.inf if until is None else float(until), axis, point)

    def to_data(self) -> dict[str, Any]:
        """Return the keys of a problem file."""
        data: dict[str, Any] = {"polynomial": self.coefficients[:SLIDES].tolist()}
        if self.axis is not None and self.point is not None:
            angle = self.coefficients[SLIDES].tolist()
            data["turn"] = {"axis": self.axis.tolist(), "angle": angle, "about": self.point.tolist()}
        return data if np.isinf(self.until) else {**data, "until": self.until}

    @property
    def size(self) -> int:
        """Number of rows, and of joints that do the motion: three that slide, and one that turns."""
        return len(self.coefficients)

    @property
    def key(self) -> tuple[Any, ...]:
        """What is equal of equal motions."""
        turn = () if self.axis is None or self.point is None else (*self.axis.tolist(), *self.point.tolist())
        ends = np.flatnonzero(np.abs(self.coefficients).max(axis=0))
        kept = self.coefficients[:, : 1 + int(ends.max(initial=0))]
        return self.until, turn, tuple(map(tuple, kept.tolist()))

    def at(self, t: Array, order: int = 0) -> Array:
        """Return the rows (N, 3 or 4), m and rad, at times t (N,), s, or their derivative of an order."""
        powers = np.arange(self.coefficients.shape[1])
        factor = np.prod([powers - i for i in range(order)], axis=0) if order else np.ones(len(powers))
        time = np.minimum(t, self.until)[:, None] ** np.maximum(powers - order, 0)
        moving = 1.0 if order == 0 else (np.asarray(t) <= self.until)[:, None]
        return np.asarray((time * factor) @ self.coefficients.T * moving)

    def largest_term(self, t: float) -> float:
        """Return the largest |c_k| s^k, m or rad, of times s from 0 to t, s: what rounding is a share of."""
        powers = np.arange(self.coefficients.shape[1])
        return float((np.abs(self.coefficients) * min(t, self.until) ** powers).max())

    def from_times(self, t: Array) -> Array:
        """Return the coefficients (N, rows, k + 1) in powers of s, 0 <= s <= `until` - t, from times t (N,) on.

        At and after `until` they are those of an obstacle that stands still.
        """
        count = self.coefficients.shape[1]
        found = np.stack([self.at(t, order) / math.factorial(order) for order in range(count)], axis=2)
        found[t >= self.until, :, 1:] = 0.0
        return found

    def pose(self, t: float) -> pin.SE3:
        """Return M(t): what is stated at X is at M(t) X."""
        rows = self.at(np.array([t]))[0]
        if self.axis is None or self.point is None:
            return pin.SE3(np.eye(3), rows)
        R = pin.exp3(rows[SLIDES] * self.axis)
        return pin.SE3(R, rows[:SLIDES] + self.point - R @ self.point)

    def places(self, x: Array, t: Array) -> Array:
        """Return where a point x (3,), m, of what moves is at times t (N,), s: M(t) x, (N, 3)."""
        rows = self.at(t)
        if self.axis is None or self.point is None:
            return np.asarray(x + rows)
        arm, angle = x - self.point, rows[:, SLIDES:]
        along = self.axis * (self.axis @ arm)
        turned = along + np.cos(angle) * (arm - along) + np.sin(angle) * np.cross(self.axis, arm)
        return np.asarray(rows[:, :SLIDES] + self.point + turned)

    def carrier(self, t: float) -> pin.SE3:
        """Return the pose of the frame of the last joint that does the motion; see `collision.moving_obstacles`."""
        return self.pose(t) * self.joint_frame

    @property
    def joint_frame(self) -> pin.SE3:
        """The pose of that frame where nothing has moved: its axis z is that of the turn."""
        if self.axis is None or self.point is None:
            return pin.SE3.Identity()
        R = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), self.axis).toRotationMatrix()
        return pin.SE3(R, self.point)

    def twist(self, X: pin.SE3, t: float) -> Array:
        """Return the velocity (6,) of a pose X (at time t) that is moved along: m/s of its origin, and rad/s."""
        now, rates = (self.at(np.array([t]), order)[0] for order in range(2))
        if self.axis is None or self.point is None:
            return np.append(rates, np.zeros(3))
        turning = rates[SLIDES] * self.axis
        arm = X.translation - self.point - now[:SLIDES]
        return np.concatenate([rates[:SLIDES] + np.cross(turning, arm), turning])
