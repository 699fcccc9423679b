"""Rigid-body dynamics of a robot with a payload: inverse for controllers, forward for the plant.

M(q) a + c(q, v) + g(q) = tau, by pinocchio. Joints that follow others are part of it: with positions A q + b of all
joints, M = A^T M_J A and h = A^T h_J (`robot.mimic_joints.unfold`).
"""

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.errors import InputError, Issue
from optiplan.robot.mimic_joints import unfold
from optiplan.robot.robot import Robot

LEAST_INERTIA = 1e-9
"""kg·m² (kg): a joint that feels less inertia than this has none; the lightest real wrist has 1e-5."""


def check_inertias(robot: Robot) -> None:
    """Raise InputError, naming the joints and links, unless every planned joint moves some inertia."""
    without = np.flatnonzero(RigidBodyDynamics(robot).felt_inertia() < LEAST_INERTIA)
    if not len(without):
        return
    links = [_link(robot, robot.joint_names[j]) for j in without]
    named = ", ".join(f"{robot.joint_names[j]} (link {link})" for j, link in zip(without, links, strict=True))
    found = f"no inertia that these joints of '{robot.name}' would move: {named}"
    expected = "<inertial> with a mass in these links of the URDF, or `mass:` in the robot's table; or `engine: ideal`"
    raise InputError([Issue("robot", None, "robot", found, expected)])


def _link(robot: Robot, joint: str) -> str:
    index = robot.model.getJointId(joint)
    for frame in robot.model.frames:
        if frame.type == pin.FrameType.BODY and frame.parentJoint == index:
            return str(frame.name)
    return joint


class RigidBodyDynamics:
    """Dynamics of the planned joints; its own work space, so one object a thread."""

    def __init__(self, robot: Robot, payload: float = 0.0, centre: Array | None = None) -> None:
        """Build the model.

        Args:
            robot: with n planned joints.
            payload: kg, a point mass at the tool.
            centre: (3,), m, of that mass in the tool frame; None: at its origin.
        """
        unfolded = unfold(robot.model)
        self._A, self._b = unfolded.A, unfolded.b
        self._plain = unfolded.model is robot.model
        self.model = pin.Model(unfolded.model)
        if payload:
            frame = self.model.frames[self.model.getFrameId(robot.tool_frame)]
            p = frame.placement.act(np.zeros(3) if centre is None else np.asarray(centre, float))
            body = pin.Inertia(payload, p, np.zeros((3, 3)))
            self.model.appendBodyToJoint(frame.parentJoint, body, pin.SE3.Identity())
        self._data = self.model.createData()
        self._tool = self.model.getFrameId(robot.tool_frame)
        self.n = robot.n

    def torque(self, q: Array, v: Array, a: Array) -> Array:
        """M(q) a + c(q, v) + g(q), (n,), N·m (N), of q, v, a (n,)."""
        if self._plain:
            return np.asarray(pin.rnea(self.model, self._data, q, v, a))
        A = self._A
        return np.asarray(A.T @ pin.rnea(self.model, self._data, A @ q + self._b, A @ v, A @ a))

    def gravity(self, q: Array) -> Array:
        """g(q), (n,), N·m (N)."""
        still = np.zeros(self.n)
        return self.torque(q, still, still)

    def mass_matrix(self, q: Array) -> Array:
        """M(q), (n, n), kg·m² (kg)."""
        M = np.array(pin.crba(self.model, self._data, q if self._plain else self._A @ q + self._b))
        M = np.triu(M.reshape(self.model.nv, -1))
        M = M + np.triu(M, 1).T
        return M if self._plain else np.asarray(self._A.T @ M @ self._A)

    def acceleration(self, q: Array, v: Array, torque: Array, armature: Array) -> Array:
        """(M(q) + diag(armature))⁻¹ (torque - c - g), (n,)."""
        if self._plain:
            self.model.armature = armature
            return np.asarray(pin.aba(self.model, self._data, q, v, torque))
        M = self.mass_matrix(q) + np.diag(armature)
        return np.asarray(np.linalg.solve(M, torque - self.torque(q, v, np.zeros(self.n))))

    def tool_jacobian(self, q: Array) -> Array:
        """J (6, n) of the tool's origin, along the axes of the world."""
        axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        full = q if self._plain else self._A @ q + self._b
        J = np.array(pin.computeFrameJacobian(self.model, self._data, full, self._tool, axes)).reshape(6, -1)
        return J if self._plain else np.asarray(J @ self._A)

    def felt_inertia(self) -> Array:
        """Largest diagonal of M over three configurations, (n,): 0 for a joint that moves nothing with a mass."""
        seen = [np.full(self.n, x) for x in (0.0, 0.7, -1.3)]
        return np.asarray(np.max([np.diag(self.mass_matrix(q)) for q in seen], axis=0))
