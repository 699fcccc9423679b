"""A platform on four mecanum wheels: wheel rates from the twist of the base and back, and what limits of one mean.

Source: H. Taheri, B. Qiao, N. Ghaeminezhad, Kinematic Model of a Four Mecanum Wheeled Mobile Robot, IJCA 113 (2015).
"""

import numpy as np

from optiplan.arrays import Array
from optiplan.records import dataclass
from optiplan.robot.robot import Robot

WHEELS = ("front_left", "front_right", "rear_left", "rear_right")
"""Order of the wheels; each turns about +y of the base, its rollers at 45°, of alternating hand (an X from above)."""


@dataclass(frozen=True)
class Mecanum:
    """Wheels of `radius`, axles `half_wheelbase` before and behind the base's origin, rollers at ±`half_track`; m."""

    radius: float
    half_wheelbase: float
    half_track: float

    @property
    def matrix(self) -> Array:
        """M, (4, 3), rad/s per m/s and per rad/s: wheel rates = M (vx, vy, wz).

        With k = half_wheelbase + half_track and r the radius,
        M = [[1, -1, -k], [1, 1, k], [1, 1, -k], [1, -1, k]] / r.
        """
        k = self.half_wheelbase + self.half_track
        rows = [[1.0, -1.0, -k], [1.0, 1.0, k], [1.0, 1.0, -k], [1.0, -1.0, k]]
        return np.array(rows) / self.radius

    def wheel_rates(self, twist: Array) -> Array:
        """Rates of the wheels, (…, 4), rad/s, that move the base with `twist` (…, 3): vx, vy in m/s, wz in rad/s.

        The twist is seen from the base: x ahead, y to the left.
        """
        rates: Array = np.asarray(twist, dtype=np.float64) @ self.matrix.T
        return rates

    def base_twist(self, rates: Array) -> Array:
        """Twist (…, 3) of the base, as in `wheel_rates`, from wheel rates (…, 4), rad/s.

        Four rates and three unknowns: rates that no twist has make rollers slip, and the least squares twist is given.
        """
        twist: Array = np.asarray(rates, dtype=np.float64) @ np.linalg.pinv(self.matrix).T
        return twist

    def velocity_limits(self, wheel_rate: float, turning: float = 1.0 / 3.0) -> Array:
        """Limits (3,) of vx and vy in the *world*, m/s, and of wz, rad/s, that keep every wheel within `wheel_rate`.

        A wheel needs |vx| + |vy| + k |wz| <= r·wheel_rate, with vx and vy in axes of the base. World velocities up to v
        have |vx| + |vy| <= 2 v at every heading. A share `turning` of r·wheel_rate is kept for wz:
        v = (1 - turning) r·wheel_rate / 2 and wz = turning r·wheel_rate / k.
        """
        rim = self.radius * wheel_rate
        v = (1.0 - turning) * rim / 2.0
        return np.array([v, v, turning * rim / (self.half_wheelbase + self.half_track)])


def wheel_matrix(robot: Robot, q: Array) -> Array | None:
    """(4, n), wheel rates, rad/s, for unit velocities of a robot's joints at q (n,); None for a robot without wheels.

    The joints of the base slide along x and y of the *world* and turn by yaw: M diag(Rz(yaw)ᵀ, 1) in their columns.
    """
    spec = robot.mecanum
    if spec is None:
        return None
    x, y, turn = (robot.joint_names.index(name) for name in spec.joints)
    c, s = np.cos(q[turn]), np.sin(q[turn])
    in_base = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    matrix = np.zeros((len(WHEELS), robot.n))
    matrix[:, [x, y, turn]] = Mecanum(spec.radius, spec.half_wheelbase, spec.half_track).matrix @ in_base
    return matrix


def wheel_rates_along(robot: Robot, Q: Array, V: Array) -> Array | None:
    """Wheel rates (k, 4), rad/s, of states Q and V (k, n) of a robot; None for one without wheels."""
    if robot.mecanum is None:
        return None
    matrices = [wheel_matrix(robot, q) for q in Q]
    return np.array([matrix @ v for matrix, v in zip(matrices, V, strict=True) if matrix is not None])
