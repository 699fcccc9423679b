"""Manipulability measures of the tool's Jacobian, their gradients, and ellipsoids."""

from typing import Literal, NamedTuple

import numpy as np

from optiplan.arrays import Array, Index
from optiplan.records import dataclass
from optiplan.robot.robot import Robot

JacobianRows = Literal["full", "translation", "rotation"]
"""Which rows of the Jacobian are measured: all six, the three of the velocity, the three of the angular velocity."""
ROWS = {"full": slice(0, 6), "translation": slice(0, 3), "rotation": slice(3, 6)}


class ToolKinematics:
    """Pose, geometric Jacobian and its derivative of one frame T of a robot, over N configurations at once.

    Args:
        robot: the robot.
        frame: T; the robot's tool frame without it.

    Raises:
        UnknownChoiceError: the robot has no such frame.
    """

    def __init__(self, robot: Robot, frame: str | None = None) -> None:
        name = robot.tool_frame if frame is None else frame
        placed = robot.model.frames[robot.frame_id(name)]
        self.kinematics = robot.kinematics
        joint, X_JT = int(placed.parentJoint), np.array(placed.placement.homogeneous)
        self._joints = _as_slice(np.flatnonzero(self.kinematics.carries[joint]))  # those that move T
        self._chain = self.kinematics.chain(joint, X_JT)
        self._slides = np.flatnonzero(self.kinematics.revolute[self._joints] < 0.5)

    def evaluate(self, Q: Array) -> tuple[Array, Array]:
        """X_WT (N, 4, 4), m, and J (N, 6, n) at Q (N, n).

        Column j of J is (z_j x (p_T - o_j), z_j) for a revolute joint with axis z_j through o_j, m/rad and 1. For a
        prismatic joint it is (z_j, 0). These are velocity of the origin of T and angular velocity, in world axes.
        The columns of followers of joint j, times their multipliers, are added to its own.
        """
        X_WT, J = self._of_joints(Q)
        return X_WT, self.kinematics.of_planned(J)

    def _of_joints(self, Q: Array) -> tuple[Array, Array]:
        """Return X_WT (N, 4, 4) and the columns of all joints, followers included: (N, 6, J)."""
        q = self.kinematics.positions(Q).T  # (J, N)
        frames = self._chain.frames(q[self._joints])
        parts = np.ascontiguousarray(frames[:, :, :3, 2:].transpose(3, 2, 0, 1))  # axes, then origins: (2, 3, L + 1, N)
        z, arm = parts[0, :, :-1], parts[1, :, -1:] - parts[1, :, :-1]
        columns = np.empty((6, *z.shape[1:]))
        columns[3:] = z
        for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            columns[i] = z[j] * arm[k] - z[k] * arm[j]
        if len(self._slides):
            columns[:3, self._slides], columns[3:, self._slides] = z[:, self._slides], 0.0
        J = np.zeros((len(Q), 6, len(q)))
        J[:, :, self._joints] = columns.transpose(2, 0, 1)
        return frames[-1], J

    def hessians(self, Q: Array) -> Array:
        """H (N, 6, n, n) at Q (N, n): H[:, :, i, j] = dJ_i / dq_j, the kinematic Hessian.

        For a joint j that carries joint i, or is it: (w_j x v_i, w_j x w_i). For j beyond i: (w_i x v_j, 0).
        Source: Haviland, Corke, "Manipulator Differential Kinematics Part 2", IEEE RAM 2024.
        """
        J = self._of_joints(Q)[1]
        v, w = J[:, :3].transpose(0, 2, 1), J[:, 3:].transpose(0, 2, 1)  # (N, J, 3)
        k = np.arange(J.shape[2])
        low, high = np.minimum.outer(k, k), np.maximum.outer(k, k)  # [i, j]
        linear, angular = (np.cross(w[:, low], part[:, high]).transpose(0, 3, 1, 2) for part in (v, w))
        H = np.concatenate([linear, np.where(np.tri(len(k), dtype=bool), angular, 0.0)], axis=1)
        H = self.kinematics.of_planned(H)
        return self.kinematics.of_planned(H.swapaxes(2, 3)).swapaxes(2, 3)


def _as_slice(indices: Index) -> Index | slice:
    """Rising indices as a slice, which NumPy takes without copying, where they follow each other."""
    first, end = (int(indices[0]), int(indices[-1]) + 1) if len(indices) else (0, 0)
    return slice(first, end) if end - first == len(indices) else indices


@dataclass(frozen=True, eq=False)
class Measures:
    """Measures of N Jacobians, each of shape (N,).

    With singular values s_1 >= … >= s_r of J (m x n), r = min(m, n):

    Attributes:
        yoshikawa: s_1 … s_r, which is sqrt(det(J J^T)), for n < m sqrt(det(J^T J)). Yoshikawa, IJRR 1985.
        asada: s_r / s_1, the inverse of the condition number. Asada, Cro Granito, ICRA 1985.
        smallest: s_r.
    """

    yoshikawa: Array
    asada: Array
    smallest: Array


def scaled(J: Array, part: JacobianRows = "full", length: float = 1.0) -> Array:
    """The rows of J (…, 6, n) that `part` names, those of the velocity divided by `length`, m.

    Metres and radians cannot be compared: what the full Jacobian measures depends on this length, 1 m unless given.
    """
    weights = np.repeat([1.0 / length, 1.0], 3)[:, None]
    return np.asarray((J * weights)[..., ROWS[part], :])


def manipulability_measures(J: Array) -> Measures:
    """Measures of Jacobians J (N, m, n)."""
    s = np.asarray(np.linalg.svd(J, compute_uv=False), dtype=np.float64)
    # Behind the largest singular value that is 0 nothing can be moved at all: not well conditioned either.
    asada: Array = np.divide(s[:, -1], s[:, 0], out=np.zeros(len(s)), where=s[:, 0] > 0.0)
    yoshikawa: Array = np.prod(s, axis=1)
    return Measures(yoshikawa, asada, s[:, -1])


def yoshikawa(J: Array) -> Array:
    """Yoshikawa's measure of Jacobians J (N, m, n), as in `manipulability_measures`: (N,).

    With J^T = Q R, for n < m J = Q R, it is |r_11 … r_rr|: as exact as the singular values, in a third of their time.
    """
    R = np.linalg.qr(J if J.shape[1] > J.shape[2] else J.swapaxes(1, 2), mode="r")
    return np.asarray(np.abs(np.diagonal(R, axis1=1, axis2=2).prod(axis=1)))


def measure_gradients(J: Array, H: Array) -> Measures:
    """Gradients of the measures with respect to q, each (N, n), from J (N, m, n) and H (N, m, n, n) = dJ_i / dq_j.

    With J = sum_k s_k u_k v_k^T, ds_k / dq_j = u_k^T (dJ / dq_j) v_k; the rest is the chain rule. Nothing is divided
    by a small singular value. Where the smallest is 0, or two are equal, the measure has a kink and one side is given.
    """
    U, s, Vt = np.linalg.svd(J, full_matrices=False)
    ds = np.einsum("nmk,nmij,nki->nkj", U, H, Vt, optimize=True)  # (N, r, n)
    others = np.stack([np.prod(np.delete(s, k, axis=1), axis=1) for k in range(s.shape[1])], axis=1)
    largest = np.maximum(s[:, :1], np.finfo(float).tiny)
    asada = (ds[:, -1] - (s[:, -1:] / largest) * ds[:, 0]) / largest
    yoshikawa: Array = np.einsum("nk,nkj->nj", others, ds)
    return Measures(yoshikawa, asada, ds[:, -1])


class Ellipsoids(NamedTuple):
    """Ellipsoids of N Jacobians of three rows, around the tool point, in world axes.

    The velocity ellipsoid {J dq : |dq| <= 1} has the semi-axes s_k u_k, the force ellipsoid {f : |J^T f| <= 1} the
    semi-axes u_k / s_k.

    Attributes:
        axes: (N, 3, 3), column k is u_k; right-handed, so a rotation matrix.
        velocity: (N, 3) m/s (rad/s for rotation) for joint speeds of norm 1, falling.
        force: (N, 3) N (N m for rotation) for joint torques of norm 1; inf where nothing can be moved.
    """

    axes: Array
    velocity: Array
    force: Array


def ellipsoids(J: Array) -> Ellipsoids:
    """Velocity and force ellipsoids of J (N, 3, n), the rows of translation or of rotation."""
    U, s, _ = np.linalg.svd(J)
    U[:, :, 2] *= np.sign(np.linalg.det(U))[:, None]
    velocity = np.zeros((len(J), 3))
    velocity[:, : s.shape[1]] = s
    force = np.divide(1.0, velocity, out=np.full_like(velocity, np.inf), where=velocity > 1e-12)
    return Ellipsoids(U, velocity, force)
