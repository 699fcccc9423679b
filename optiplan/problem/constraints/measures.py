"""What a path constraint measures at poses of its frame, beside its limit."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.problem.constraints.statements import (
    OnLine,
    OnPlane,
    OrientationCone,
    PairClearance,
    PathConstraint,
    PositionBox,
    RelativePose,
    ToolSpeed,
)
from optiplan.robot.robot import Robot

ROUNDING = 1e-9
"""Of the coordinates of a pose; constraints hold up to it."""

Feature = Literal["point", "axis", "rotation"]


@dataclass(frozen=True, eq=False)
class Measure:
    """A convex function of the coordinates of a frame's pose, that must not exceed a limit.

    Attributes:
        quantity: what it is, for people.
        unit: m or rad, of what `told` gives.
        limit: of the value.
        feature: which coordinates it is a function of: the origin (3,) of the frame (`point`), a unit vector fixed to
            it (`axis`), or its rotation matrix, nine numbers (`rotation`). No step of these changes the value by more
            than the length of the step.
        value: of poses (N, 4, 4): (N,).
        told: the value, or the limit, in the words of the constraint: metres as they are, chords as angles.
    """

    quantity: str
    unit: str
    limit: float
    feature: Feature
    value: Callable[[Array], Array]
    told: Callable[[float], float] = float


def measures(one: PathConstraint) -> list[Measure]:
    """Return what a constraint of poses measures; nothing for those of speeds and of pairs.

    An angle between unit vectors a and b is told by its chord, |a - b| = 2 sin(angle / 2), and one between rotations by
    |R - S|_F = 2 sqrt(2) sin(angle / 2): convex in the coordinates, as angles are not.
    """
    if isinstance(one, OrientationCone):
        return [_cone(one)]
    if isinstance(one, PositionBox):
        inverse, half = np.linalg.inv(one.X_WC.homogeneous), 0.5 * np.asarray(one.size)

        def outside(X: Array) -> Array:
            local = X[:, :3, 3] @ inverse[:3, :3].T + inverse[:3, 3]
            return np.asarray((np.abs(local) - half).max(axis=1))

        return [Measure("out of the box", "m", 0.0, "point", outside)]
    if isinstance(one, OnPlane):
        return [
            Measure("off the plane", "m", one.within, "point", lambda X: np.abs(X[:, :3, 3] @ one.normal - one.offset))
        ]
    if isinstance(one, OnLine):
        return [Measure("off the line", "m", one.within, "point", lambda X: _to_segment(X[:, :3, 3], one))]
    return _relative(one) if isinstance(one, RelativePose) else []


def broken(one: PathConstraint, robot: Robot, q: Array) -> list[str]:
    """Return in words what a configuration q (n,) violates, with both values."""
    own = measures(one)
    if not own or isinstance(one, ToolSpeed | PairClearance):
        return []
    X = FramePoses.of(robot, one)(q[None])
    values = [(each, float(each.value(X)[0])) for each in own]
    return [
        f"{each.quantity} by {each.told(value):.4g} {each.unit} of {each.told(each.limit):.4g} {each.unit} allowed"
        for each, value in values
        if value > each.limit + ROUNDING
    ]


class FramePoses:
    """Poses of a frame in the world, or in another frame."""

    def __init__(self, robot: Robot, frame: str, base: str | None = None) -> None:
        self._model, self._data = robot.model, robot.model.createData()
        self._frame = robot.frame_id(frame)
        self._base = None if base is None else robot.frame_id(base)

    @classmethod
    def of(cls, robot: Robot, one: PathConstraint) -> "FramePoses":
        """Return the poses that a constraint of one is about."""
        if isinstance(one, PairClearance):
            raise TypeError("clearance is of bodies, not of a frame")
        return cls(robot, one.frame, one.to if isinstance(one, RelativePose) else None)

    def __call__(self, Q: Array) -> Array:
        """Return X (N, 4, 4) at configurations Q (N, n)."""
        found = np.empty((len(Q), 4, 4))
        for k, q in enumerate(Q):
            pin.framesForwardKinematics(self._model, self._data, q)
            X = self._data.oMf[self._frame]
            found[k] = (X if self._base is None else self._data.oMf[self._base].inverse() * X).homogeneous
        return found


def _cone(one: OrientationCone) -> Measure:
    def chord(X: Array) -> Array:
        return np.asarray(np.linalg.norm(X[:, :3, :3] @ one.axis - one.toward, axis=1))

    return Measure("tilted", "rad", 2.0 * np.sin(0.5 * min(one.within, np.pi)), "axis", chord, _of_chord)


def _relative(one: RelativePose) -> list[Measure]:
    p, R = one.X_TF.translation, one.X_TF.rotation

    def turned(X: Array) -> Array:
        return np.asarray(np.linalg.norm((X[:, :3, :3] - R).reshape(len(X), 9), axis=1))

    limit = 2.0 * np.sqrt(2.0) * np.sin(0.5 * min(one.orientation, np.pi))
    return [
        Measure("off its position", "m", one.position, "point", lambda X: np.linalg.norm(X[:, :3, 3] - p, axis=1)),
        Measure("turned", "rad", limit, "rotation", turned, lambda value: _of_chord(value / np.sqrt(2.0))),
    ]


def _to_segment(points: Array, one: OnLine) -> Array:
    """Distances (N,), m, of points (N, 3) from the segment."""
    along = one.end - one.start
    length = float(along @ along)
    share = np.clip((points - one.start) @ along / length, 0.0, 1.0) if length > 0.0 else np.zeros(len(points))
    return np.asarray(np.linalg.norm(points - one.start - share[:, None] * along, axis=1))


def _of_chord(value: float) -> float:
    return 2.0 * float(np.arcsin(min(1.0, max(0.0, 0.5 * value))))
