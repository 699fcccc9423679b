"""What a path constraint measures at poses of its frame, beside its limit."""

from collections.abc import Callable
from typing import Any, Literal

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.problem.constraints.base import circle_of
from optiplan.problem.constraints.points import OnArc, OnCircle, OnLine, OnPlane, PositionBox
from optiplan.problem.constraints.poses import FixedOrientation, LookAt, OnScrew, OrientationCone, RelativePose
from optiplan.problem.constraints.statements import PathConstraint, frame_of
from optiplan.records import dataclass
from optiplan.robot.robot import Robot

ROUNDING = 1e-9
"""Of the coordinates of a pose, m or rad; constraints hold up to it."""

Feature = Literal["point", "axis", "rotation"]

Growth = Callable[[Array, Array, Array], Array]


@dataclass(frozen=True, eq=False)
class Measure:
    """A function of the coordinates of a frame's pose that must not exceed a limit.

    Attributes:
        quantity: what it is, for people.
        unit: m or rad, of what `shown` gives.
        limit: of the value.
        feature: which coordinates it is a convex function of: the origin (3,) of the frame (`point`), a unit vector
            fixed to it (`axis`), or its rotation matrix, nine numbers (`rotation`). No step of these changes the value
            by more than the length of the step.
        value: of poses (N, 4, 4): (N,).
        shown: the value, or the limit, in the words of the constraint: metres as they are, chords as angles.
        rounding: of the value; constraints hold up to it.
        growth: of a function that is not convex: by how much it grows at most from poses (N, 4, 4) on when the origin
            travels by at most (N,) m and the frame turns by at most (N,) rad.
    """

    quantity: str
    unit: str
    limit: float
    feature: Feature
    value: Callable[[Array], Array]
    shown: Callable[[float], float] = float
    growth: Growth | None = None
    rounding: float = ROUNDING

    @property
    def allowed(self) -> float:
        """The limit with its rounding, up to which the constraint holds."""
        return self.limit + self.rounding


def measures(one: PathConstraint) -> list[Measure]:
    """Return what a constraint of poses measures; nothing for those of speeds, joints and pairs.

    An angle between unit vectors a and b is told by its chord, |a - b| = 2 sin(angle / 2), and one between rotations by
    |R - S|_F = 2 sqrt(2) sin(angle / 2): convex in the coordinates, as angles are not.
    """
    make = _KINDS.get(type(one))
    return [] if make is None else make(one)


class FramePoses:
    """Poses of a frame in the world, or in another frame."""

    def __init__(self, robot: Robot, frame: str, base: str | None = None) -> None:
        self._model, self._data = robot.model, robot.model.createData()
        self._frame = robot.frame_id(frame)
        self._base = None if base is None else robot.frame_id(base)

    @classmethod
    def of(cls, robot: Robot, one: PathConstraint) -> "FramePoses":
        """Return the poses that a constraint of one is about."""
        frame = frame_of(one)
        if frame is None:
            raise TypeError(f"{one.KEY} is not about a frame")
        return cls(robot, frame, one.to if isinstance(one, RelativePose) else None)

    def __call__(self, Q: Array) -> Array:
        """Return X (N, 4, 4) at configurations Q (N, n)."""
        found = np.empty((len(Q), 4, 4))
        for k, q in enumerate(Q):
            found[k] = self.at(q).homogeneous
        return found

    def at(self, q: Array) -> pin.SE3:
        """Return the pose at one configuration (n,)."""
        pin.framesForwardKinematics(self._model, self._data, q)
        X = self._data.oMf[self._frame]
        return X.copy() if self._base is None else self._data.oMf[self._base].inverse() * X


def _cone(one: OrientationCone) -> list[Measure]:
    def chord(X: Array) -> Array:
        return np.asarray(np.linalg.norm(X[:, :3, :3] @ one.axis - one.toward, axis=1))

    return [Measure("tilted", "rad", _chord(one.within), "axis", chord, _of_chord, rounding=_rounding(one.within))]


def _box(one: PositionBox) -> list[Measure]:
    inverse, half = np.linalg.inv(one.X_WC.homogeneous), 0.5 * np.asarray(one.size)

    def outside(X: Array) -> Array:
        local = X[:, :3, 3] @ inverse[:3, :3].T + inverse[:3, 3]
        return np.asarray((np.abs(local) - half).max(axis=1))

    return [Measure("out of the box", "m", 0.0, "point", outside)]


def _plane(one: OnPlane) -> list[Measure]:
    return [Measure("off the plane", "m", one.within, "point", lambda X: np.abs(X[:, :3, 3] @ one.normal - one.offset))]


def _line(one: OnLine) -> list[Measure]:
    return [Measure("off the line", "m", one.within, "point", lambda X: _to_segment(X[:, :3, 3], one))]


def _circle(one: OnCircle) -> list[Measure]:
    def off(X: Array) -> Array:
        return _to_circle(X[:, :3, 3] - one.centre, one.normal, one.radius)

    return [Measure("off the circle", "m", one.within, "point", off, growth=_travel)]


def _arc(one: OnArc) -> list[Measure]:
    centre, normal, radius, angle = circle_of(one.start, one.through, one.end)
    x = (one.start - centre) / radius
    y = np.cross(normal, x)

    def off(X: Array) -> Array:
        p = X[:, :3, 3]
        inside = np.arctan2((p - centre) @ y, (p - centre) @ x) % (2.0 * np.pi) <= angle
        ends = np.minimum(*(np.linalg.norm(p - end, axis=1) for end in (one.start, one.end)))
        return np.where(inside, _to_circle(p - centre, normal, radius), ends)

    return [Measure("off the arc", "m", one.within, "point", off, growth=_travel)]


def _screw(one: OnScrew) -> list[Measure]:
    """Return the distance from the pose of the screw that is turned as the frame is, as a share of the tolerances.

    That pose is on the screw whatever the turn, so the distance bounds that from the screw. The turn t is that of the
    twist about the axis: with the swing s beside it, |t'| <= |w| / cos(s / 2), and cos(s / 2)' >= -|w| / 2. The pose of
    the screw then moves by sqrt(r^2 + pitch^2) |t'|, r from the axis, and turns by |t'|.
    """
    R, p = np.asarray(one.X_WF.rotation), np.asarray(one.X_WF.translation) - one.point
    lever = float(np.hypot(np.linalg.norm(np.cross(one.axis, p)), one.pitch))

    def twist_of(X: Array) -> tuple[Array, Array]:
        """Sine and cosine of the twist, both times cos(s / 2)^2."""
        D = X[:, :3, :3] @ R.T
        skew = np.stack([D[:, 2, 1] - D[:, 1, 2], D[:, 0, 2] - D[:, 2, 0], D[:, 1, 0] - D[:, 0, 1]], axis=1)
        sine = 0.5 * skew @ one.axis
        cosine = 0.5 * (np.trace(D, axis1=1, axis2=2) - one.axis @ (D @ one.axis).T)
        return sine, cosine

    def share(X: Array) -> Array:
        sine, cosine = twist_of(X)
        turn = np.arctan2(sine, cosine)
        slid = (X[:, :3, 3] - one.point - p) @ one.axis
        if one.pitch != 0.0:  # of several turns the one that slides as far
            turn = turn + 2.0 * np.pi * np.round((slid / one.pitch - turn) / (2.0 * np.pi))
        rotation = np.array([pin.exp3(one.axis * t) for t in turn])
        wanted = one.point + rotation @ p + one.pitch * turn[:, None] * one.axis
        off = np.linalg.norm(X[:, :3, 3] - wanted, axis=1) / one.position
        chord = np.linalg.norm((X[:, :3, :3] - rotation @ R).reshape(len(X), 9), axis=1) / np.sqrt(2.0)
        return np.asarray(np.maximum(off, chord / _chord(one.orientation)))

    def growth(X: Array, travel: Array, turn: Array) -> Array:
        sine, cosine = twist_of(X)
        swing = np.sqrt(np.hypot(sine, cosine)) - 0.5 * turn  # cos(s / 2), at least
        twist = np.divide(turn, swing, out=np.full_like(turn, np.inf), where=swing > 0.0)
        return np.asarray(np.maximum((travel + lever * twist) / one.position, (turn + twist) / _chord(one.orientation)))

    rounding = min(ROUNDING, _rounding(one.orientation) / _chord(one.orientation))
    return [Measure("off the screw", "of its tolerance", 1.0, "point", share, growth=growth, rounding=rounding)]


def _fixed(one: FixedOrientation) -> list[Measure]:
    return [_turned(one.within, _turned_from(np.asarray(one.R_WF)))]


def _turned_from(R: Array) -> Callable[[Array], Array]:
    """Return how far poses (k, 4, 4) are turned from R, as the norm of the difference of the matrices (k,)."""
    return lambda X: np.asarray(np.linalg.norm((X[:, :3, :3] - R).reshape(len(X), 9), axis=1))


def _look(one: LookAt) -> list[Measure]:
    def sight(X: Array) -> tuple[Array, Array]:
        ray = one.target - X[:, :3, 3]
        distance = np.linalg.norm(ray, axis=1)
        axis = X[:, :3, :3] @ one.axis
        across = np.linalg.norm(np.cross(axis, ray), axis=1)
        return np.arctan2(across, np.einsum("ni,ni->n", axis, ray)), distance

    def growth(X: Array, travel: Array, turn: Array) -> Array:
        """A target at distance d is seen at most asin(travel / d) elsewhere."""
        distance = sight(X)[1]
        share = np.divide(travel, distance, out=np.ones_like(travel), where=distance > travel)
        return np.asarray(turn + np.where(distance > travel, np.arcsin(share), np.pi))

    return [Measure("looking aside", "rad", one.within, "axis", lambda X: sight(X)[0], growth=growth)]


def _relative(one: RelativePose) -> list[Measure]:
    p, R = one.X_TF.translation, one.X_TF.rotation
    return [
        Measure("off its position", "m", one.position, "point", lambda X: np.linalg.norm(X[:, :3, 3] - p, axis=1)),
        _turned(one.orientation, _turned_from(R)),
    ]


def _to_segment(points: Array, one: OnLine) -> Array:
    """Distances (N,), m, of points (N, 3) from the segment."""
    along = one.end - one.start
    length = float(along @ along)
    share = np.clip((points - one.start) @ along / length, 0.0, 1.0) if length > 0.0 else np.zeros(len(points))
    return np.asarray(np.linalg.norm(points - one.start - share[:, None] * along, axis=1))


def _to_circle(p: Array, normal: Array, radius: float) -> Array:
    """Distances (N,), m, of points (N, 3) from a circle about the origin."""
    height = p @ normal
    across = np.linalg.norm(p - height[:, None] * normal, axis=1)
    return np.asarray(np.hypot(across - radius, height))


def _travel(X: Array, travel: Array, turn: Array) -> Array:
    """Return how far a distance from a fixed set of points grows: as far as the point travels."""
    return travel


def _chord(angle: float) -> float:
    return 2.0 * float(np.sin(0.5 * min(angle, np.pi)))


def _rounding(angle: float) -> float:
    """Return how much longer the chord of an angle may be: near half a turn, `ROUNDING` rad make it hardly longer."""
    return _chord(angle + ROUNDING) - _chord(angle) if angle + ROUNDING < np.pi else ROUNDING


def _turned(within: float, value: Callable[[Array], Array]) -> Measure:
    root = float(np.sqrt(2.0))
    shown, rounding = _of_chord_of_rotation, root * _rounding(within)
    return Measure("turned", "rad", root * _chord(within), "rotation", value, shown, rounding=rounding)


def _of_chord(value: float) -> float:
    return 2.0 * float(np.arcsin(min(1.0, max(0.0, 0.5 * value))))


def _of_chord_of_rotation(value: float) -> float:
    return _of_chord(value / np.sqrt(2.0))


_KINDS: dict[type[Any], Callable[[Any], list[Measure]]] = {
    OrientationCone: _cone,
    PositionBox: _box,
    OnPlane: _plane,
    OnLine: _line,
    OnCircle: _circle,
    OnArc: _arc,
    OnScrew: _screw,
    FixedOrientation: _fixed,
    LookAt: _look,
    RelativePose: _relative,
}
