"""The tool on its path: errors, Jacobians and corrections of many configurations at once.

Rows of the error e and of the Jacobian J, in world axes: the place of the origin (three rows); the turn that brings the
z axis to its direction, seen across it (two rows), or as far as its cone; or the whole rotation (three rows). A
correction is the shortest in z = q / velocity limit: dq = D J_z^T (J_z J_z^T + damping)^-1 e, J_z = J D.
"""

import numpy as np

from optiplan.arrays import Array, Flags, Index
from optiplan.problem.seams.actions import SeamPath
from optiplan.records import dataclass
from optiplan.robot.robot import Robot

_LONGEST = 0.4
"""rad or m: of a joint in one correction."""

_MET = 1e-9
"""m and rad: an error that small is none."""

_DAMPING = 1e-10
"""Share of the mean square of J_z, m² and rad²."""


@dataclass(frozen=True, eq=False)
class ToolRows:
    """Errors e (N, m), m and rad, and Jacobians J (N, m, n) of N configurations; `tilt` (N,), rad, of the axis."""

    e: Array
    J: Array
    tilt: Array


@dataclass(frozen=True, eq=False)
class ToolPlaces:
    """Where the tool should be in N configurations: lengths s (N,), points (N, 3), and its axes as R_WF (N, 3, 3)."""

    s: Array
    p: Array
    R: Array

    def take(self, chosen: Flags | Index) -> "ToolPlaces":
        """Return some of them."""
        return ToolPlaces(self.s[chosen], self.p[chosen], self.R[chosen])


class SeamTool:
    """Kinematics of a robot whose frame follows a path.

    Attributes:
        equalities: rows of the error that are held exactly.
    """

    def __init__(self, robot: Robot, path: SeamPath) -> None:
        self.robot, self.path = robot, path
        self.spins = path.curve.heading is None
        self.equalities = 3 if path.cone > 0.0 else 5 if self.spins else 6
        self.scale = robot.limits.velocity
        frame = robot.model.frames[robot.frame_id(path.frame)]
        self._joint, self._placement = int(frame.parentJoint), np.array(frame.placement.homogeneous)
        self._kinematics = robot.kinematics
        self._moves = self._kinematics.carries[self._joint]
        self._turns = self._kinematics.revolute > 0.5

    def places(self, s: Array) -> ToolPlaces:
        """Return where the tool should be at lengths s (N,), m."""
        return ToolPlaces(s, self.path.curve.points(s), self.path.curve.rotations(s))

    def poses(self, Q: Array) -> Array:
        """Return the tool's poses (N, 4, 4) in configurations Q (N, n)."""
        return np.asarray(self._kinematics.poses(Q)[:, self._joint] @ self._placement)

    def rows(self, Q: Array, at: ToolPlaces, cone: float) -> ToolRows:
        """Return errors and Jacobians in configurations Q (N, n); tilts up to `cone`, rad, are no error."""
        joints = self._kinematics.poses(Q)
        X = joints[:, self._joint] @ self._placement
        direction, point = self._kinematics.axes(joints)
        linear = np.where(self._turns[:, None], np.cross(direction, X[:, None, :3, 3] - point), direction)
        angular = np.where(self._turns[:, None], direction, 0.0)
        J = np.concatenate([linear, angular], axis=2) * self._moves[:, None]
        J = np.swapaxes(J, 1, 2) @ self._kinematics.coupling  # (N, 6, n)
        off = at.p - X[:, :3, 3]
        turn, tilt = _turns(X[:, :3, :3], at.R, whole=not self.spins)
        kept = np.maximum(tilt - cone, 0.0) / np.maximum(tilt, 1e-12)
        turn, turning = turn * kept[:, None], J[:, 3:]
        if self.spins:
            across = at.R[:, :, :2]
            turn, turning = np.einsum("nij,ni->nj", across, turn), np.einsum("nij,nik->njk", across, turning)
        if cone > 0.0:
            turning = turning * (kept > 0.0)[:, None, None]
        return ToolRows(np.concatenate([off, turn], axis=1), np.concatenate([J[:, :3], turning], axis=1), tilt)

    def corrected(self, Q: Array, at: ToolPlaces, steps: int) -> tuple[Array, Array]:
        """Return configurations (N, n) with the tool in place, and the largest error (N,) that is left, m or rad."""
        Q, worst = Q.copy(), np.full(len(Q), np.inf)
        left = np.arange(len(Q))
        low, high = self.robot.limits.lower, self.robot.limits.upper
        for _ in range(steps):
            rows = self.rows(Q[left], at.take(left), self.path.cone)
            worst[left] = np.abs(rows.e).max(axis=1)
            going = worst[left] > _MET
            left, e, J = left[going], rows.e[going], rows.J[going]
            if not len(left):
                break
            step = self.shortest(J, e, _DAMPING + 1e-3 * np.minimum(1.0, np.abs(e).max(axis=1)) ** 2)
            size = np.abs(step).max(axis=1, initial=0.0)
            step *= np.minimum(1.0, _LONGEST / np.maximum(size, 1e-12))[:, None]
            Q[left] = np.clip(Q[left] + step, low, high)
        if len(left):
            worst[left] = np.abs(self.rows(Q[left], at.take(left), self.path.cone).e).max(axis=1)
        return Q, worst

    def shortest(self, J: Array, e: Array, damping: Array | float) -> Array:
        """Return the shortest motions (N, n) that make the errors e (N, m) vanish; damped by shares (N,)."""
        Jz = J * self.scale
        A = Jz @ np.swapaxes(Jz, 1, 2)
        m = A.shape[1]
        size = np.trace(A, axis1=1, axis2=2) / m
        A[:, range(m), range(m)] += np.maximum(size * damping, 1e-12)[:, None]
        x = np.linalg.solve(A, e[:, :, None])
        return np.asarray(self.scale * (np.swapaxes(Jz, 1, 2) @ x)[:, :, 0])

    def free_motions(self, J: Array) -> Array:
        """Return motions (N, n, r) that leave the rows of J (N, m, n) alone, of unit length in z."""
        _, _, Vt = np.linalg.svd(J * self.scale, full_matrices=True)
        return np.asarray(self.scale[:, None] * np.swapaxes(Vt[:, J.shape[1] :], 1, 2))


def _turns(R: Array, wanted: Array, whole: bool) -> tuple[Array, Array]:
    """Return rotation vectors (N, 3), rad, from R to the wanted rotation or its z axis, and their angles (N,)."""
    if whole:
        D = wanted @ np.swapaxes(R, 1, 2)
        skew = 0.5 * np.stack([D[:, 2, 1] - D[:, 1, 2], D[:, 0, 2] - D[:, 2, 0], D[:, 1, 0] - D[:, 0, 1]], axis=1)
        sine, cosine = np.linalg.norm(skew, axis=1), 0.5 * (np.trace(D, axis1=1, axis2=2) - 1.0)
    else:
        skew = np.cross(R[:, :, 2], wanted[:, :, 2])
        sine, cosine = np.linalg.norm(skew, axis=1), (R[:, :, 2] * wanted[:, :, 2]).sum(axis=1)
    angle = np.arctan2(sine, cosine)
    unit = np.where(sine[:, None] > 1e-12, skew / np.maximum(sine, 1e-12)[:, None], wanted[:, :, 0])
    return angle[:, None] * unit, angle
