"""Goal regions: sets of poses by the bounds of six coordinates.

Source: Berenson, Srinivasa, Kuffner, "Task Space Regions", IJRR 2011; rotations here are vectors, not Euler angles.
"""

from dataclasses import replace
from functools import cached_property

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array, cross
from optiplan.geometry.poses import ReadOnlyPoses
from optiplan.records import dataclass

_MOST_ROOM = 2e-3
"""m and rad: half a width that `inner` counts with at most; the errors of planned ends are far less."""


@dataclass(frozen=True, eq=False)
class RegionGoal(ReadOnlyPoses):
    """End with `frame` anywhere in a region: low <= coordinates(X_WF) <= high.

    The coordinates are those of the motion T = X_WR^-1 X_WF X_RF^-1, which is the identity in the middle of the region:
    its translation in the axes of the region, m, and a vector of its rotation R, rad. That is log(R) where no rotation
    is free. Where one about an axis e is free, R is split in a turn about e, which is that coordinate, and the shortest
    rotation from e to R e, whose vector has the other two.

    Attributes:
        frame: a link or fixed frame of the robot.
        X_WR: pose of the region in the world.
        X_RF: pose of the frame in the region, in its middle.
        low, high: (6,) bounds, m and rad, infinite where free.
    """

    frame: str
    X_WR: pin.SE3
    X_RF: pin.SE3
    low: Array
    high: Array

    @cached_property
    def free(self) -> tuple[int, ...]:
        """The axes, of 0, 1 and 2, about which the frame may turn as it likes."""
        return tuple(k for k in range(3) if np.isinf(self.low[3 + k]) and np.isinf(self.high[3 + k]))

    @property
    def oriented(self) -> bool:
        """Whether the orientation counts."""
        return len(self.free) < 3

    def coordinates(self, X_WF: pin.SE3) -> Array:
        """Return the coordinates (6,) of a pose, m and rad."""
        T = self._motion(X_WF)
        if len(self.free) != 1:
            return np.concatenate([T.translation, pin.log3(T.rotation)])
        axis = self.free[0]
        tilt = _tilt(T.rotation[:, axis], axis)
        tilt[axis] = pin.log3(pin.exp3(tilt).T @ T.rotation)[axis]
        return np.concatenate([T.translation, tilt])

    def pose(self, coordinates: Array) -> pin.SE3:
        """Return X_WF of coordinates (6,): the inverse of `coordinates`."""
        shift, turn = coordinates[:3], np.array(coordinates[3:])
        rotation = pin.exp3(turn)
        if len(self.free) == 1:
            about = np.zeros(3)
            about[self.free[0]], turn[self.free[0]] = turn[self.free[0]], 0.0
            rotation = pin.exp3(turn) @ pin.exp3(about)
        return self.X_WR * pin.SE3(rotation, np.array(shift)) * self.X_RF

    def rates(self, X_WF: pin.SE3) -> Array:
        """Return A (6, 6): d coordinates / dt = A (v, w), the twist of the frame's origin in world axes.

        Zero in the row of a rotation that is free.
        """
        T, to_region = self._motion(X_WF), self.X_WR.rotation.T
        arm = X_WF.rotation @ self.X_RF.inverse().translation
        turned = to_region if len(self.free) != 1 else np.zeros((3, 3))
        if not self.free:
            turned = pin.Jlog3(T.rotation.T) @ to_region
        elif len(self.free) == 1:
            axis = self.free[0]
            a = T.rotation[:, axis]
            turned = _tilt_rates(a, axis) @ -pin.skew(a) @ to_region
        result = np.zeros((6, 6))
        result[:3, :3], result[:3, 3:], result[3:, 3:] = to_region, -to_region @ pin.skew(arm), turned
        result[[3 + axis for axis in self.free]] = 0.0
        return result

    def excess(self, X_WF: pin.SE3) -> Array:
        """Return by how much the coordinates of a pose are beyond their bounds, (6,) m and rad; zero inside."""
        c = self.coordinates(X_WF)
        return np.asarray(c - np.clip(c, self.low, self.high))

    def contains(self, X_WF: pin.SE3) -> bool:
        """Return whether a pose is in the region."""
        return not self.excess(X_WF).any()

    def nearest(self, X_WF: pin.SE3) -> pin.SE3:
        """Return the pose in the region whose coordinates are nearest to those of another."""
        return self.pose(np.clip(self.coordinates(X_WF), self.low, self.high))

    def moved(self, X_WC: pin.SE3) -> "RegionGoal":
        """Return the region in the world, where this one is in a frame C that is at X_WC."""
        return replace(self, X_WR=X_WC * self.X_WR)

    def inner(self, share: float) -> "RegionGoal":
        """Return the region with `share` of each width, as if none were wider than 4 mm or mrad."""
        room = (1.0 - share) * np.minimum(0.5 * (self.high - self.low), _MOST_ROOM)
        return replace(self, low=self.low + room, high=self.high - room)

    def drawn(self, near: pin.SE3, rng: np.random.Generator) -> pin.SE3:
        """Return a pose of the region: uniform where bounded, as that of `near` where free."""
        bounded = np.isfinite(self.low) & np.isfinite(self.high)
        low, high = (np.where(bounded, bound, 0.0) for bound in (self.low, self.high))
        there = np.clip(self.coordinates(near), self.low, self.high)
        return self.pose(np.where(bounded, rng.uniform(low, high), there))

    def _motion(self, X_WF: pin.SE3) -> pin.SE3:
        return self.X_WR.inverse() * X_WF * self.X_RF.inverse()


def _tilt(a: Array, axis: int) -> Array:
    """Return the vector (3,), rad, of the shortest rotation from an axis to the direction a (3,)."""
    e = np.eye(3)[axis]
    across = cross(e, a)
    sine = float(np.linalg.norm(across))
    if sine < 1e-12:
        return np.zeros(3) if a[axis] > 0.0 else np.pi * np.eye(3)[(axis + 1) % 3]
    return np.asarray(across * (np.arctan2(sine, a[axis]) / sine))


def _tilt_rates(a: Array, axis: int) -> Array:
    """Return the derivative (3, 3) of `_tilt`.

    With c = e · a and f(c) = acos(c) / sin(acos(c)): f skew(e) + (e x a) (df/dc) e^T,
    df/dc = (angle c - sine) / sine^3, -1/3 at c = 1.
    """
    e = np.eye(3)[axis]
    across = cross(e, a)
    sine, c = float(np.linalg.norm(across)), float(a[axis])
    angle = float(np.arctan2(sine, c))
    if sine < 1e-4:
        f, slope = 1.0 + angle**2 / 6.0, -1.0 / 3.0
    else:
        f, slope = angle / sine, (angle * c - sine) / sine**3
    return np.asarray(f * pin.skew(e) + slope * np.outer(across, e))
