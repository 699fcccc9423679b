"""References of the tool: lines, arcs, circles and screws in time, targets that move for ever, recorded poses."""

from dataclasses import field

import numpy as np
import pinocchio as pin
from scipy.spatial.transform import Rotation, RotationSpline

from optiplan.arrays import Array
from optiplan.planners.cartesian.tool_path import ToolPath
from optiplan.records import dataclass
from optiplan.simulation.references.base import ToolTarget
from optiplan.trajectory.profiles.laws import LawPoint, quintic_at


@dataclass(frozen=True, eq=False)
class PathReference:
    """A tool path X_WF(s) run through once with s(t) = 10 u³ - 15 u⁴ + 6 u⁵, u = t / duration: from rest to rest.

    Attributes:
        frame: F.
        path: line, arc, circle or screw.
        duration: s.
    """

    frame: str
    path: ToolPath
    duration: float

    def at(self, t: float) -> ToolTarget:
        """Target at time t, s: twist X'(s) s', acceleration X'(s) s'' + X''(s) s'²."""
        s, rate, change = _eased(max(t, 0.0), self.duration)
        along = self.path.twist(s)
        return ToolTarget(self.path.pose(s), along * rate, along * change + self.path.twist_rate(s) * rate**2)


@dataclass(frozen=True, eq=False)
class MovingTarget:
    """A target that swings about a pose: p(t) = p0 + w(t) A sin(2 pi f t), each axis with its own amplitude and rate.

    The weight w(t) rises smoothly from 0 to 1 within `ease`, s, and falls likewise at the end, so that the target
    begins and ends at rest; the orientation is kept.

    Attributes:
        frame: the frame that follows.
        centre: X_WF at rest.
        amplitude: A (3,), m, along the axes of the world; `frequency`: f (3,), Hz; `phase`: (3,), rad.
        duration: s.
    """

    frame: str
    centre: pin.SE3
    amplitude: Array
    frequency: Array
    duration: float
    phase: Array = field(default_factory=lambda: np.zeros(3))
    ease: float = 1.0

    def at(self, t: float) -> ToolTarget:
        """Target at time t, s."""
        t = min(max(t, 0.0), self.duration)
        w, dw, ddw = _eased(min(t, self.duration - t), min(self.ease, 0.5 * self.duration))
        dw = dw if t < 0.5 * self.duration else -dw
        rate = 2.0 * np.pi * self.frequency
        x, y = np.sin(rate * t + self.phase), np.cos(rate * t + self.phase)
        x0 = np.sin(self.phase)
        swing, speed, change = x - x0, rate * y, -(rate**2) * x
        p = w * swing
        v = dw * swing + w * speed
        a = ddw * swing + 2.0 * dw * speed + w * change
        still = np.zeros(3)
        there = pin.SE3(self.centre.rotation, self.centre.translation + self.amplitude * p)
        rates = np.concatenate([self.amplitude * v, still]), np.concatenate([self.amplitude * a, still])
        return ToolTarget(there, *rates)


class RecordedPath:
    """Poses at given times, such as a demonstration: cubic splines through positions and through orientations.

    Source of the second: scipy's `RotationSpline`, whose angular velocity is continuous.

    Attributes:
        frame: F.
        duration: s; the first sample is at 0.
    """

    def __init__(self, frame: str, t: Array, positions: Array, quaternions: Array) -> None:
        """Fit the splines.

        Args:
            frame: F.
            t: (K,) increasing, s, K >= 2.
            positions: (K, 3), m.
            quaternions: (K, 4), [x, y, z, w] of unit length.
        """
        from scipy.interpolate import CubicSpline  # takes a third of a second

        self.frame, self.duration = frame, float(t[-1] - t[0])
        times = t - t[0]
        self._position = CubicSpline(times, positions, bc_type="clamped" if len(t) > 2 else "natural")
        self._rotation = RotationSpline(times, Rotation.from_quat(quaternions))

    def at(self, t: float) -> ToolTarget:
        """Target at time t, s; at its ends it stands."""
        moving = 0.0 < t < self.duration
        t = min(max(t, 0.0), self.duration)
        R = self._rotation(t).as_matrix()
        X = pin.SE3(R, np.asarray(self._position(t)))
        if not moving:
            return ToolTarget(X, np.zeros(6), np.zeros(6))
        # RotationSpline gives w and its rate along the axes of F; d/dt (R w) = R w' since R' w = R (w x w) = 0.
        twist = np.concatenate([self._position(t, 1), R @ self._rotation(t, 1)])
        return ToolTarget(X, twist, np.concatenate([self._position(t, 2), R @ self._rotation(t, 2)]))


def _eased(t: float, ease: float) -> LawPoint:
    """Return `QUINTIC` at u = t / ease, and 1 beyond, with its derivatives in time, 1/s and 1/s²."""
    if t >= ease:
        return LawPoint(1.0, 0.0, 0.0)
    law = quintic_at(t / ease)
    return LawPoint(law.s, law.rate / ease, law.change / ease**2)
