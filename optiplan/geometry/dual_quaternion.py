"""Unit dual quaternions and screw motion, over `pinocchio.SE3`."""

import math

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.geometry.poses import HALF_TURN
from optiplan.records import dataclass

_CONJUGATE = np.array([1.0, -1.0, -1.0, -1.0])
_SERIES = tuple((-1) ** (n + 1) * 2 * (n + 1) / math.factorial(2 * n + 3) for n in reversed(range(9)))
"""Coefficients of x^16 … x^0 in (cos x - sin x / x) / x²."""


@dataclass(frozen=True, eq=False)
class DualQuaternion:
    """real + ε dual with ε² = 0, both of shape (4,), scalar first: [w, x, y, z].

    A pose X_AB = (R, p), p in m, is the unit dual quaternion r + ε ½ (0, p) r, where r stands for R; minus that is the
    same pose. X_AB X_BC is the product of the two. Unit means |real| = 1 and real · dual = 0.

    Source: K. Daniilidis, "Hand-eye calibration using dual quaternions", IJRR 1999.
    """

    real: Array
    dual: Array

    @classmethod
    def from_pose(cls, X_AB: pin.SE3) -> "DualQuaternion":
        """Return the dual quaternion of a pose whose real[0] >= 0, up to rounding."""
        x, y, z, w = pin.Quaternion(X_AB.rotation).coeffs()
        real = np.array([w, x, y, z]) if w >= 0.0 else -np.array([w, x, y, z])
        return cls(real, 0.5 * _product(np.array([0.0, *X_AB.translation]), real))

    @classmethod
    def exp(cls, twist: Array) -> "DualQuaternion":
        """Return the pose of `pin.exp6`: one second of motion with the constant twist (v, w), (6,), m/s and rad/s.

        With a = w/2, b = v/2, φ = |a|, sinc φ = sin φ / φ and k = (cos φ - sinc φ) / φ²,
        real = (cos φ, sinc φ a) and dual = (-sinc φ a·b, sinc φ b + k (a·b) a): smooth in the twist everywhere.
        """
        b, a = 0.5 * np.asarray(twist, float).reshape(2, 3)
        phi = math.hypot(*a)
        sinc, along = _sinc(phi), float(a @ b)
        real = np.array([math.cos(phi), *(sinc * a)])
        return cls(real, np.array([-sinc * along, *(sinc * b + _sinc_slope(phi) * along * a)]))

    def log(self) -> Array:
        """Return the twist (v, w), (6,), m and rad, of the shorter rotation, as `pin.log6`: exp(log(q)) = ±q, |w| <= π.

        The inverse of `exp` with φ = atan2(|vec real|, real[0]) in [0, π/2], where sinc φ >= 2/π, so no division by
        zero occurs. `shorter` chooses the direction of a half turn.
        """
        q = self.shorter()
        phi = math.atan2(math.hypot(*q.real[1:]), q.real[0])
        sinc = _sinc(phi)
        a = q.real[1:] / sinc
        along = -q.dual[0] / sinc
        b = (q.dual[1:] - _sinc_slope(phi) * along * a) / sinc
        return np.concatenate([2.0 * b, 2.0 * a])

    def power(self, exponent: float) -> "DualQuaternion":
        """Return exp(exponent log(q)): that share of the screw motion of q."""
        return DualQuaternion.exp(exponent * self.log())

    def towards(self, other: "DualQuaternion", tau: float) -> "DualQuaternion":
        """Interpolate by ScLERP: X_W0 (X_W0⁻¹ X_W1)^τ, one screw motion from this pose, τ = 0, to the other, τ = 1.

        Source: L. Kavan et al., "Dual quaternions for rigid transformation blending", 2006.
        """
        return self * (self.conjugate * other).power(tau)

    @property
    def position(self) -> Array:
        """Position of the pose: p = vec(2 dual real*), (3,), m."""
        return np.asarray(2.0 * _product(self.dual, _CONJUGATE * self.real)[1:])

    def pose(self) -> pin.SE3:
        """X_AB."""
        w, x, y, z = self.real
        return pin.SE3(pin.Quaternion(w, x, y, z).toRotationMatrix(), self.position)

    def shorter(self) -> "DualQuaternion":
        """Return q or -q, whichever turns by π at most.

        At a half turn, |real[0]| < 1e-9, both do. Then the first nonzero component of the axis is made positive:
        rounding does not choose the direction.
        """
        deciding = next((x for x in self.real if abs(x) > HALF_TURN), 1.0)
        return self if deciding > 0.0 else DualQuaternion(-self.real, -self.dual)

    def __mul__(self, other: "DualQuaternion") -> "DualQuaternion":
        """(a + ε b)(c + ε d) = a c + ε (a d + b c)."""
        dual = _product(self.real, other.dual) + _product(self.dual, other.real)
        return DualQuaternion(_product(self.real, other.real), dual)

    @property
    def conjugate(self) -> "DualQuaternion":
        """The conjugate real* + ε dual*, with negated vector parts: the inverse of a unit dual quaternion."""
        return DualQuaternion(_CONJUGATE * self.real, _CONJUGATE * self.dual)


def screw_between(X_W0: pin.SE3, X_W1: pin.SE3, tau: float) -> pin.SE3:
    """Return `DualQuaternion.towards` of poses."""
    return DualQuaternion.from_pose(X_W0).towards(DualQuaternion.from_pose(X_W1), tau).pose()


def _product(a: Array, b: Array) -> Array:
    """Hamilton's product of quaternions (4,), scalar first."""
    aw, ax, ay, az = a.tolist()
    bw, bx, by, bz = b.tolist()
    return np.array(
        [
            aw * bw - ax * bx - ay * by - az * bz,
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
        ]
    )


def _sinc(x: float) -> float:
    return math.sin(x) / x if x != 0.0 else 1.0


def _sinc_slope(x: float) -> float:
    """Return (cos x - sin x / x) / x² = sinc'(x) / x, for x < 1 by its series, which is exact to rounding."""
    if x >= 1.0:
        return (math.cos(x) - math.sin(x) / x) / x**2
    value, square = 0.0, x * x
    for coefficient in _SERIES:
        value = value * square + coefficient
    return value
