"""Forward kinematics of many configurations at once, in NumPy: link poses and joint axes."""

from collections.abc import Sequence
from functools import cached_property

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from optiplan.arrays import Array, Index
from optiplan.robot.mimic_joints import coupling, screws


class BatchKinematics:
    """Poses of the J joints, revolute or prismatic, of a model with n planned ones, over N configurations.

    With X_PJ the fixed placement of joint j in its parent and [S] its unit screw, X_WJ = X_WP X_PJ exp([S] q_j). The
    positions of all joints are A q + b. The row of a planned joint in A is that of the identity. The row of a follower
    is that of its leader times the multiplier, and b has its offset. Without followers J = n and A is the identity.

    Attributes:
        coupling: A (J, n); `offset`: b (J,), rad or m.
        follows: whether there are followers.
        revolute: (J,), 1 for a joint that turns, 0 for one that slides.
        carries: (J + 1, J) which joints carry what is fixed to each joint, and to the world, which is 0.
    """

    def __init__(self, model: pin.Model) -> None:
        self._parents = [int(p) for p in model.parents]
        self._placements = [np.array(M.homogeneous) for M in model.jointPlacements]
        self._screws = screws(model)
        self.carries = carrying_joints(model)
        self._terms = _motion_terms(self._placements[1:], self._screws)
        self.coupling, self.offset = coupling(model)
        self.follows = model.njoints - 1 > model.nv
        self.revolute: Array = (np.linalg.norm(self._screws[:, 3:], axis=1) > 0.5).astype(np.float64)
        self._axis = np.where(self.revolute[:, None] > 0.5, self._screws[:, 3:], self._screws[:, :3])
        self._along = _columns(self._axis)
        self._across = np.linalg.svd(self._axis[:, None])[2][:, 1:].swapaxes(1, 2)  # (J, 3, 2) at right angles to them
        self._to_axis = np.concatenate([np.eye(4)[None], _rotations(self._across, self._axis)])  # takes z to each axis
        before = self._to_axis[self._parents[1:]].swapaxes(1, 2)
        self._between_axes = before @ np.array(self._placements[1:]).reshape(-1, 4, 4) @ self._to_axis[1:]

    def positions(self, Q: Array) -> Array:
        """Positions (..., J) of all joints, of those of the planned ones Q (..., n): A q + b."""
        return self.joint_rates(Q) + self.offset if self.follows else Q

    def joint_rates(self, V: Array) -> Array:
        """Rates (..., J) of all joints, of those of the planned ones V (..., n): A V."""
        return V @ self.coupling.T if self.follows else V

    def joint_reach(self, D: Array) -> Array:
        """Bounds (..., J) of all joints, from bounds D (..., n) >= 0 on what the planned ones do: |A| D."""
        return D @ np.abs(self.coupling.T) if self.follows else D

    def joint_dependence(self, moved: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
        """Return which planned joints (..., n) take part where the joints `moved` (..., J) do."""
        return np.asarray((moved @ np.abs(self.coupling)) > 0.0) if self.follows else moved

    def planned_bound(self, moment_arms: Array) -> Array:
        """Bounds (..., n) for each rad or m of a planned joint, from those for each of any joint (..., J): |A|^T l."""
        return moment_arms @ np.abs(self.coupling) if self.follows else moment_arms

    def of_planned(self, gradient: Array) -> Array:
        """Gradients (..., n) in the planned joints, from those in all joints (..., J): A^T g."""
        return gradient @ self.coupling if self.follows else gradient

    def poses(self, Q: Array) -> Array:
        """X_WJ of every joint (0 is the world) at configurations Q (N, n): array (N, J + 1, 4, 4)."""
        q = self.positions(Q).T  # (J, N)
        local = np.stack([np.ones_like(q), np.sin(q), 1.0 - np.cos(q), q], axis=2) @ self._terms
        local = local.reshape(*q.shape, 4, 4)
        result = np.empty((len(Q), len(self._parents), 4, 4))
        result[:, 0] = np.eye(4)
        for j in range(1, len(self._parents)):
            np.matmul(result[:, self._parents[j]], local[j - 1], out=result[:, j])
        return result

    def chain(self, joint: int, X_JF: Array) -> "SerialChain":
        """The joints that carry joint `joint`, itself included, as `carries` has them, and a frame F fixed to it."""
        joints = np.flatnonzero(self.carries[joint])
        constants = [*self._between_axes[joints], self._to_axis[joint].T @ X_JF]
        return SerialChain(constants, self.revolute[joints] > 0.5)

    def axes(self, poses: Array) -> tuple[Array, Array]:
        """Axis direction and a point on it, in the world, of each joint: two arrays (N, J, 3)."""
        point = poses[:, 1:, :3, 3].copy()
        if self._along is None:
            return (poses[:, 1:, :3, :3] @ self._axis[:, :, None])[..., 0], point
        joints = np.arange(1, poses.shape[1])
        return np.ascontiguousarray(poses[:, joints, :3, self._along].swapaxes(0, 1)), point

    def across_axes(self, poses: Array) -> Array:
        """Rows a_1 and a_2 (N, 2 J, 4), first of all joints, then second, that map points to planes across their axes.

        The distance of a point p from the axis of a joint is the length of (a_1 (p, 1), a_2 (p, 1)), m.
        """
        rows = np.empty((len(poses), 2, poses.shape[1] - 1, 4))
        rows[..., :3] = (poses[:, 1:, :3, :3] @ self._across).transpose(0, 3, 1, 2)
        rows[..., 3] = -np.einsum("nsji,nji->nsj", rows[..., :3], poses[:, 1:, :3, 3])
        return rows.reshape(len(poses), -1, 4)

    def moment_arms(self, joint: int, points: Array, stroke: Array) -> Array:
        """Bounds, m, on how far points (…, K, 3) fixed to a joint travel for each rad or m of each joint: (…, J).

        Holds at: every configuration with |q_j| <= stroke_j; `stroke` (n,) matters for prismatic joints only, m. Seen
        from the frame of a joint, what the next joint carries stays within a ball about that joint's origin, which
        is fixed there. A revolute joint has the distance from its axis, a prismatic one 1, one that does not carry the
        points 0. A follower f stays within |multiplier| stroke + |offset|.
        """
        reach = self.joint_reach(stroke) + np.abs(self.offset)
        result = np.zeros((*points.shape[:-2], len(reach)))
        ball = np.zeros(points.shape[:-2])
        if joint == 0:
            return result
        across = _from_axis(points, self._screws[joint - 1, 3:]).max(axis=-1)
        along = np.linalg.norm(points, axis=-1).max(axis=-1)
        while joint > 0:
            if self.revolute[joint - 1]:
                result[..., joint - 1] = across + ball
            else:
                result[..., joint - 1] = 1.0
                ball = ball + float(reach[joint - 1])
            ball = ball + along
            across, along = self._origins[joint]
            joint = self._parents[joint]
        return result

    @cached_property
    def _origins(self) -> list[tuple[float, float]]:
        """Distance, m, of each joint's origin from the axis of its parent joint, and from that one's origin."""
        places = [placement[None, :3, 3] for placement in self._placements]
        before = [self._screws[parent - 1, 3:] for parent in self._parents]
        across = [float(_from_axis(place, axis)[0]) for place, axis in zip(places, before, strict=True)]
        return list(zip(across, (float(np.linalg.norm(place)) for place in places), strict=True))


def _from_axis(points: Array, axis: Array) -> Array:
    """Distances (…) of points (…, 3) from the line along an axis (3,), a unit vector, through the origin."""
    x, y, z = np.moveaxis(points, -1, 0)
    u, v, w = axis.tolist()
    return np.asarray(np.sqrt((y * w - z * v) ** 2 + (z * u - x * w) ** 2 + (x * v - y * u) ** 2))


def _rotations(across: Array, axis: Array) -> Array:
    """Rotations (J, 4, 4) whose columns are two directions `across` (J, 3, 2) an axis and the axis (J, 3)."""
    found = np.tile(np.eye(4), (len(axis), 1, 1))
    found[:, :3, :2], found[:, :3, 2] = across, axis
    found[:, :3, 0] *= np.sign(np.linalg.det(found))[:, None]
    return found


def carrying_joints(model: pin.Model) -> npt.NDArray[np.bool_]:
    """Return which joints (J + 1, J) carry what is fixed to each joint, and to the world, which is 0."""
    carries = np.zeros((model.njoints, model.njoints - 1), dtype=bool)
    for j in range(1, model.njoints):
        carries[j] = carries[model.parents[j]]
        carries[j, j - 1] = True
    return carries


def _motion_terms(placements: list[Array], screws: Array) -> Array:
    """C (J, 4, 16) of X_PJ exp([S] q) = C_0 + sin(q) C_1 + (1 - cos(q)) C_2 + q C_3, each C_k a matrix (4, 4).

    [S] is a unit rotation about, or a unit translation along, an axis through the origin.
    """
    terms = np.zeros((len(placements), 4, 4, 4))
    for j, (linear, angular) in enumerate(zip(screws[:, :3], screws[:, 3:], strict=True)):
        skew = np.zeros((4, 4))
        skew[:3, :3] = pin.skew(angular)
        slide = np.zeros((4, 4))
        slide[:3, 3] = linear
        terms[j] = placements[j] @ np.stack([np.eye(4), skew, skew @ skew, slide])
    return terms.reshape(-1, 4, 16)


def _columns(axes: Array) -> Index | None:
    """Which coordinate axis each of `axes` (J, 3) is: (J,), its products being columns; None where one is none."""
    column = np.abs(axes).argmax(axis=1)
    return column if np.array_equal(axes, np.eye(3)[column]) else None


class SerialChain:
    """Frame F behind a chain of L joints, revolute or prismatic, each carried by the one before, over N configurations.

    X_PJ is the fixed placement of joint j in its parent. B_j is a rotation that takes z to its axis. Z(q) turns about z
    or slides along it. With K_j = B_P^T X_PJ B_j and K_F = B_L^T X_LF, X_WF = K_1 Z(q_1) K_2 Z(q_2) … K_L Z(q_L) K_F.
    So a joint takes one product with a constant matrix for all N at once.

    Args:
        constants: the L + 1 matrices K (4, 4), m.
        turns: (L,) which joints turn; the others slide.
    """

    def __init__(self, constants: Sequence[Array], turns: npt.NDArray[np.bool_]) -> None:
        self._constants, self._turns = constants, turns.tolist()

    def frames(self, q: Array) -> Array:
        """Frames of the joints, whose z is the joint's axis, and X_WF last, at positions q (L, N): (L + 1, N, 4, 4)."""
        L, N = q.shape
        rows = np.empty((L + 1, 4 * N, 4))
        frames = rows.reshape(L + 1, N, 4, 4)
        # Columns x and y of a frame as x + i y: a turn about z by q takes them times exp(-i q).
        across, turn = rows.view(np.complex128).reshape(L + 1, N, 4, 2)[..., 0], _turned_back(q)[..., None]
        frames[0] = self._constants[0]
        for j, turns in enumerate(self._turns):
            if turns:
                across[j] *= turn[j]
            else:
                frames[j, :, :, 3] += q[j, :, None] * frames[j, :, :, 2]
            np.matmul(rows[j], self._constants[j + 1], out=rows[j + 1])
        return frames


def _turned_back(q: Array) -> npt.NDArray[np.complex128]:
    """exp(-i q) as (1 - i u)^2 / (1 + u^2), u = tan(q / 2): a tangent, which NumPy vectorises, for sine and cosine."""
    u = np.tan(0.5 * q)
    half = 1.0 / (1.0 + u * u)
    found = np.empty(q.shape, dtype=np.complex128)
    found.real, found.imag = 2.0 * half - 1.0, -2.0 * u * half
    return found


def inverse_poses(X: Array) -> Array:
    """Return the inverses of homogeneous poses (N, 4, 4)."""
    result = np.zeros_like(X)
    result[:, :3, :3] = X[:, :3, :3].transpose(0, 2, 1)
    result[:, :3, 3] = -np.einsum("nij,nj->ni", result[:, :3, :3], X[:, :3, 3])
    result[:, 3, 3] = 1.0
    return result
