"""Tasks of one frame of the robot in the world: pose, position, orientation."""

from typing import ClassVar

import numpy as np
import pinocchio as pin

from optiplan._core import core
from optiplan.arrays import Array
from optiplan.control.arguments import checked_vector, pose_cost
from optiplan.control.configuration import Configuration
from optiplan.control.tasks.base import MovedFrameTask, Weight, capped
from optiplan.control.tasks.targets import Target, as_pose, as_position, as_rotation


class FrameTask(MovedFrameTask):
    """What tasks of a frame F of the robot share: its target T and how that moves.

    Attributes:
        target: X_WT; None until one is set: the task then holds the pose that F has in the first step.
    """

    def __init__(self, frame: str, size: int, cost: Weight, gain: float | None, priority: int) -> None:
        super().__init__(frame, size, cost, gain, priority)
        self._target: pin.SE3 | None = None
        self.twist = self.acceleration = None

    @property
    def twist(self) -> Array | None:
        """Velocity of T (6,), m/s and rad/s, axes of the world; None: T stands."""
        return self._twist

    @twist.setter
    def twist(self, value: object) -> None:
        self._twist = None if value is None else checked_vector(self, "twist", value, 6)

    @property
    def acceleration(self) -> Array | None:
        """Rates of the twist (6,), m/s² and rad/s²; None: zeros."""
        return self._acceleration

    @acceleration.setter
    def acceleration(self, value: object) -> None:
        self._acceleration = None if value is None else checked_vector(self, "acceleration", value, 6)

    @property
    def target(self) -> pin.SE3 | None:
        """X_WT; setting it ends what feed-forward there was."""
        return self._target

    @target.setter
    def target(self, pose: Target) -> None:
        self.set_target(pose)

    def set_target(self, pose: Target, twist: object = None, acceleration: object = None) -> None:
        """Where F should be now, how that moves, and how its motion changes.

        Args:
            pose: X_WT as `pinocchio.SE3`, `op.Pose` or (4, 4).
            twist: (6,), see the attributes; None: T stands.
            acceleration: (6,), of accelerations-level control; None: zeros.

        Raises:
            InputError: no pose, or other than six finite numbers.
        """
        self._target = self._read(pose)
        self.twist, self.acceleration = twist, acceleration

    def _read(self, pose: Target) -> pin.SE3:
        return as_pose(self, pose)

    def _poses(self, c: Configuration) -> tuple[pin.SE3, pin.SE3]:
        """X_WF and X_WT; without a target, F stays where it is first seen."""
        X_WF = c.pose(self._frame)
        if self._target is None:
            self._target = pin.SE3(X_WF)
        return X_WF, self._target

    def _rows_of(self, c: Configuration, motion: Array) -> Array:
        """Rates (k,) of the error that a motion (6,) of F or T in the axes of the world is.

        Of a rotation to first order in the angle between F and T.
        """
        raise NotImplementedError

    def feed_forward(self, c: Configuration) -> Array | None:
        """The target's twist as rates of the error."""
        return None if self.twist is None else self._rows_of(c, self.twist)

    def feed_forward_rate(self, c: Configuration) -> Array | None:
        """The target's acceleration as rates of the error."""
        return None if self.acceleration is None else self._rows_of(c, self.acceleration)

    def drift(self, c: Configuration) -> Array:
        """J̇ v (k,)."""
        return self._rows_of(c, c.jacobian_rate(self._frame).dot(c.v))  # `dot` takes half of the time of @ here

    def _turning(self, R_TF: Array, R_WF: Array) -> Array:
        """Jlog(R_TF) R_FW (3, 3), which takes angular velocities to rates of log(R_TF)."""
        return np.asarray(pin.Jlog3(R_TF) @ R_WF.T)


class PoseTask(FrameTask):
    """Frame F of the robot at a target T: e = (p_WF - p_WT, log(R_TF)).

    The first three rows are metres along the axes of the world, so that F moves straight, the others radians about
    the axes of F. J = (J_v, Jlog(R_TF) R_FW J_w).

    Args:
        frame: name of F.
        target: X_WT; None: where F is in the first step, until `set_target`.
        position_cost: per metre, one or three along the axes of the world.
        orientation_cost: per radian, one or three about the axes of F.
        gain: 1/s, however far the target is; None: as large as the robot's jerk limits allow, and less where the target
            is so far that the robot could not slow down in time.
        priority: see `ControlTask`.

    Example:
        >>> import optiplan as op
        >>> op.PoseTask("panda_hand_tcp")
        PoseTask(frame=panda_hand_tcp, cost=[1.0])
    """

    name: ClassVar[str] = "pose"
    components = ("x", "y", "z", "rotation x", "rotation y", "rotation z")

    def __init__(
        self,
        frame: str,
        target: Target | None = None,
        position_cost: Weight = 1.0,
        orientation_cost: Weight = 1.0,
        gain: float | None = None,
        priority: int = 0,
    ) -> None:
        super().__init__(frame, 6, 1.0, gain, priority)
        self.cost = pose_cost(self, position_cost, orientation_cost)
        if target is not None:
            self.set_target(target)

    def error(self, c: Configuration) -> Array:
        """(6,), m and rad."""
        return self.evaluate(c)[0]

    def jacobian(self, c: Configuration) -> Array:
        """(6, n)."""
        return self.evaluate(c)[1]

    def evaluate(self, c: Configuration) -> tuple[Array, Array]:
        """Error and Jacobian."""
        X_WF, X_WT = self._poses(c)
        J = c.jacobian(self._frame)
        if core is not None:
            e, J, self._turn = core.pose_rows(X_WF.homogeneous, X_WT.homogeneous, J)
            return e, J
        R_WF = X_WF.rotation
        R_TF = X_WT.rotation.T @ R_WF
        self._turn = np.eye(6)  # takes twists along the axes of the world to rates of the error
        self._turn[3:, 3:] = self._turning(R_TF, R_WF)
        return np.append(X_WF.translation - X_WT.translation, pin.log3(R_TF)), self._turn @ J

    def _rows_of(self, c: Configuration, motion: Array) -> Array:
        return np.asarray(self._turn.dot(motion))

    def wanted_rate(self, e: Array) -> Array:
        """See `MovedFrameTask`."""
        return self._pose_rate(e)

    def __repr__(self) -> str:
        """Frame and weights."""
        return f"{type(self).__name__}(frame={self.frame}, cost={np.unique(self.cost).tolist()})"


class _HalfOfPose(FrameTask):
    """The position or the orientation of a frame."""

    def __init__(
        self, frame: str, target: object = None, cost: Weight = 1.0, gain: float | None = None, priority: int = 0
    ) -> None:
        super().__init__(frame, 3, cost, gain, priority)
        if target is not None:
            self.set_target(target)


class PositionTask(_HalfOfPose):
    """The origin of a frame F at a point: e = p_WF - p_WT, metres along the axes of the world; J = J_v.

    Args:
        frame: name of F.
        target: point [x, y, z], m, or a pose; None: where F is in the first step.
        cost: per metre, one or three.
        gain: as of `PoseTask`.
        priority: see `ControlTask`.
    """

    name: ClassVar[str] = "position"
    components = ("x", "y", "z")

    def _read(self, pose: Target) -> pin.SE3:
        return as_position(self, pose)

    def error(self, c: Configuration) -> Array:
        """(3,), m."""
        X_WF, X_WT = self._poses(c)
        return np.asarray(X_WF.translation - X_WT.translation)

    def jacobian(self, c: Configuration) -> Array:
        """(3, n)."""
        return c.jacobian(self._frame)[:3]

    def _rows_of(self, c: Configuration, motion: Array) -> Array:
        return motion[:3]

    def wanted_rate(self, e: Array) -> Array:
        """Within what the robot's joints give."""
        return capped(e, self.gain, *self._moves)


class OrientationTask(_HalfOfPose):
    """The axes of a frame F along those of a target T: e = log(R_TF), radians about the axes of F.

    J = Jlog(R_TF) R_FW J_w.

    Args:
        frame: name of F.
        target: R_WT (3, 3), [roll, pitch, yaw], or a pose; None: as F is in the first step.
        cost: per radian, one or three.
        gain: as of `PoseTask`.
        priority: see `ControlTask`.
    """

    name: ClassVar[str] = "orientation"
    components = ("rotation x", "rotation y", "rotation z")

    def _read(self, pose: Target) -> pin.SE3:
        return as_rotation(self, pose)

    def error(self, c: Configuration) -> Array:
        """(3,), rad."""
        return np.asarray(pin.log3(self._rotations(c)[0]))

    def _rotations(self, c: Configuration) -> tuple[Array, Array]:
        """R_TF and R_WF."""
        X_WF, X_WT = self._poses(c)
        R_WF = X_WF.rotation
        return X_WT.rotation.T @ R_WF, R_WF

    def jacobian(self, c: Configuration) -> Array:
        """(3, n)."""
        return self._turning(*self._rotations(c)) @ c.jacobian(self._frame)[3:]

    def _rows_of(self, c: Configuration, motion: Array) -> Array:
        return np.asarray(self._turning(*self._rotations(c)) @ motion[3:])

    def wanted_rate(self, e: Array) -> Array:
        """Within what the robot's joints give."""
        return capped(e, self.gain, *self._turns)
