"""Tasks of the joints themselves: posture, damping, coupling, and the motion of a mobile base."""

from collections.abc import Iterable, Sequence
from typing import ClassVar

import numpy as np
import pinocchio as pin

from optiplan._core import core
from optiplan.arrays import Array
from optiplan.control.arguments import checked_vector
from optiplan.control.configuration import Configuration
from optiplan.control.tasks.base import ControlTask, Weight, capped
from optiplan.errors import described, wrong_argument
from optiplan.robot.given_configurations import configuration, is_by_name
from optiplan.robot.robot import Robot

POSTURE_COST = 1e-2
"""Per rad or m: a hundredth of a pose's, so that posture decides only what the tool leaves open."""


class _EachJoint(ControlTask):
    """A task whose rows are the joints: J is the identity, and size and cost are taken when the robot is known."""

    by_joint = True

    def __init__(self, cost: Weight, gain: float, priority: int) -> None:
        super().__init__(0, cost, gain, priority)

    def bind(self, robot: Robot) -> None:
        """Take the size from the robot."""
        self.size = robot.n
        self.cost = self._given_cost
        self._eye = np.eye(robot.n)

    @property
    def cost(self) -> Array:
        """Weights (n,) of the joints."""
        return self._cost

    @cost.setter
    def cost(self, value: Weight) -> None:
        count = len(value) if isinstance(value, Sequence) else np.size(value)
        self._cost = checked_vector(self, "cost", value, self.size or count, least=0.0)  # of any size before `bind`
        self._given_cost = value if count == 1 else self._cost.copy()

    def jacobian(self, c: Configuration) -> Array:
        """(n, n), the identity."""
        return self._eye


class PostureTask(_EachJoint):
    """Joints at a configuration: e = q - target; J the identity.

    Args:
        target: (n,) or `{joint: value}`, rad or m, or the name of a configuration; None: as the robot stands
            in the first step.
        cost: per rad or m, one or (n,).
        gain: 1/s.
        priority: see `ControlTask`.
    """

    name: ClassVar[str] = "posture"

    def __init__(
        self,
        target: object = None,
        cost: Weight = POSTURE_COST,
        gain: float = 1.0,
        priority: int = 0,
    ) -> None:
        super().__init__(cost, gain, priority)
        self._given = target  # until a robot is known
        self._target: Array | None = None

    def bind(self, robot: Robot) -> None:
        """Take sizes and named configurations from the robot."""
        super().bind(robot)
        self._speed, self._brake = robot.limits.velocity, 0.5 * robot.limits.acceleration
        if isinstance(self._given, str) or is_by_name(self._given):
            names = robot.joint_names, robot.configurations
            self._given = configuration(*names, self._given, "PostureTask", "target")
        if self._given is not None:
            self.target = self._given

    @property
    def target(self) -> Array | None:
        """(n,), rad or m."""
        return self._target

    @target.setter
    def target(self, value: object) -> None:
        if self.size:
            self._target = checked_vector(self, "target", _listed(value), self.size)
        self._given = value if self._target is None else self._target.copy()

    def error(self, c: Configuration) -> Array:
        """(n,), rad or m."""
        if self._target is None:
            self._target = c.q.copy()
        return c.q - self._target

    def wanted_rate(self, e: Array) -> Array:
        """Each joint within half of its acceleration, so that it can slow down in time."""
        if core is not None:
            return core.curbed(e, self.gain, self._brake, self._speed)
        rate = -self.gain * e
        if not (np.abs(rate) * self.gain > self._brake).any():
            return rate
        size = np.abs(e)
        slower = np.sqrt(2.0 * self._brake * np.maximum(size - 0.5 * self._brake / self.gain**2, 0.0))
        curbed = np.where(size * self.gain**2 > self._brake, slower, self.gain * size)
        return np.asarray(-np.sign(e) * np.minimum(curbed, self._speed))


class DampingTask(_EachJoint):
    """Joints at rest: J v = 0 with J the identity.

    Args:
        cost: per rad/s or m/s, one or (n,).
        priority: see `ControlTask`.
    """

    name: ClassVar[str] = "damping"

    def __init__(self, cost: Weight = 1e-2, priority: int = 0) -> None:
        super().__init__(cost, 0.0, priority)

    def error(self, c: Configuration) -> Array:
        """Zeros (n,)."""
        return np.zeros(self.size)


class JointCouplingTask(ControlTask):
    """Joints that move together: e = A q - b; J = A.

    Args:
        A: (k, n), the combinations; one row may be given as (n,).
        b: (k,), what they should be.
        cost: per unit, one or (k,).
        gain: 1/s.
        priority: see `ControlTask`.

    Raises:
        InputError: A is no finite matrix (k, n), in the controller one of other joints; or b has another size.
    """

    name: ClassVar[str] = "joint coupling"

    def __init__(self, A: object, b: object = 0.0, cost: Weight = 1.0, gain: float = 10.0, priority: int = 0) -> None:
        try:
            matrix = np.atleast_2d(np.asarray(A, dtype=np.float64))
        except (TypeError, ValueError, OverflowError):
            raise wrong_argument("JointCouplingTask", "A", described(A), "a matrix (k, n)") from None
        if matrix.ndim != 2 or not np.isfinite(matrix).all():
            raise wrong_argument("JointCouplingTask", "A", described(A), "a finite matrix (k, n)")
        super().__init__(len(matrix), cost, gain, priority)
        self.A, self.b = matrix, checked_vector(self, "b", b, len(matrix))

    def bind(self, robot: Robot) -> None:
        """Hold the size against the robot."""
        if self.A.shape[1] != robot.n:
            found, expected = f"a matrix of {self.A.shape[1]} columns", f"{robot.n}, one a joint"
            raise wrong_argument("JointCouplingTask", "A", found, expected)

    def error(self, c: Configuration) -> Array:
        """(k,)."""
        return np.asarray(self.A @ c.q - self.b)

    def jacobian(self, c: Configuration) -> Array:
        """(k, n) = A."""
        return self.A


class BaseMotionTask(ControlTask):
    """The mobile base of a robot at a place, or moving with a twist: e = (x, y, yaw) - target, yaw within ±π.

    J picks the joints of the base. The twist is seen from the base: x ahead, y to the left.

    Args:
        target: (x, y, yaw) in the world, m and rad; None: no place, only the twist.
        twist: (vx, vy, wz), m/s and rad/s, that the base should have; None: none.
        cost: per m and rad, one or three.
        gain: 1/s.
        joints: names of the joints that slide along x and y and turn; None: those of the robot's mecanum wheels.
        priority: see `ControlTask`.
    """

    name: ClassVar[str] = "base motion"
    components = ("x", "y", "yaw")

    def __init__(
        self,
        target: object = None,
        twist: object = None,
        cost: Weight = 1.0,
        gain: float = 2.0,
        joints: Sequence[str] | None = None,
        priority: int = 0,
    ) -> None:
        super().__init__(3, cost, gain, priority)
        self.joints = joints
        self.target = target
        self.twist = twist

    @property
    def target(self) -> Array | None:
        """(3,): x, y, m, and yaw, rad."""
        return self._target

    @target.setter
    def target(self, value: object) -> None:
        self._target = None if value is None else checked_vector(self, "target", _listed(value), 3)

    @property
    def twist(self) -> Array | None:
        """(3,): vx, vy, m/s, and wz, rad/s, seen from the base."""
        return self._twist

    @twist.setter
    def twist(self, value: object) -> None:
        self._twist = None if value is None else checked_vector(self, "twist", _listed(value), 3)

    def bind(self, robot: Robot) -> None:
        """Find the joints of the base."""
        names = self.joints
        if names is None and robot.mecanum is not None:
            names = robot.mecanum.joints
        if names is None:
            expected = "names of the joints along x, y and about z, for a robot whose file names no wheels"
            raise wrong_argument("BaseMotionTask", "joints", "None", expected)
        given = list(names) if isinstance(names, Iterable) else []
        known = {name for name in given if isinstance(name, str) and name in robot.joint_names}
        if not len(known) == len(given) == 3:
            expected = f"three of: {', '.join(robot.joint_names)}"
            raise wrong_argument("BaseMotionTask", "joints", described(names), expected)
        self._columns = [robot.joint_names.index(name) for name in given]
        self._J = np.zeros((3, robot.n))
        self._J[[0, 1, 2], self._columns] = 1.0
        limits = robot.limits
        self._speed, self._brake = limits.velocity[self._columns], 0.5 * limits.acceleration[self._columns]

    def error(self, c: Configuration) -> Array:
        """(3,), m and rad."""
        if self._target is None:
            return np.zeros(3)
        e = c.q[self._columns] - self._target
        e[2] = (e[2] + np.pi) % (2.0 * np.pi) - np.pi
        return np.asarray(e)

    def jacobian(self, c: Configuration) -> Array:
        """(3, n)."""
        return self._J

    def wanted_rate(self, e: Array) -> Array:
        """Within what the joints of the base give."""
        place = capped(e[:2], self.gain, float(self._speed[:2].min()), float(self._brake[:2].min()))
        return np.append(place, capped(e[2:], self.gain, float(self._speed[2]), float(self._brake[2])))

    def feed_forward(self, c: Configuration) -> Array | None:
        """The twist in the axes of the world."""
        if self._twist is None:
            return None
        return np.asarray(pin.utils.rotate("z", float(c.q[self._columns[2]])) @ self._twist)


def _listed(value: object) -> object:
    """Refuse a single number where a vector is meant."""
    return [value] if isinstance(value, int | float) else value
