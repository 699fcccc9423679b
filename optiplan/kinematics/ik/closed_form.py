"""Inverse kinematics in closed form: all branches, up to eight, of many poses at once.

The branches are shoulder x elbow x wrist. With the wrist point (c, in the arm frame A of `arm_recognition`):

    rho^2 = c_x^2 + c_y^2;  r = ± sqrt(rho^2 - lateral^2);  q1 = atan2(c_y, c_x) - atan2(lateral, r)
    D = exp(i q2) (upper + exp(i q3) fore);  cos beta = (|D|^2 - |upper|^2 - |fore|^2) / (2 |upper| |fore|)
    q3 = ± beta - arg fore + arg upper;  q2 = arg D - arg(upper + exp(i q3) fore)

with D the vector from axis 2 to P or, with three parallel axes, to axis 4, whose place follows from q1, q5 and q6.
Every angle is computed from the angles before it, so that later angles compensate their rounding. So the pose is met
even at singularities. Sources: Pieper 1968; Hawkins, "Analytic inverse kinematics for the Universal Robots
UR-5/UR-10 arms", 2013.
"""

from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array, Flags, Index
from optiplan.kinematics.ik.arm_recognition import ArmGeometry, recognise
from optiplan.kinematics.ik.closed_form_branches import SIGNS, Places, branch_names, spherical_wrist, three_parallel
from optiplan.records import dataclass
from optiplan.robot.batched.kinematics import BatchKinematics, inverse_poses
from optiplan.robot.frames import pose_errors
from optiplan.robot.robot import Robot

ACCURACY = 1e-9
"""A branch is valid when forward kinematics meets the pose this well, m and rad."""

_BLOCK = 2048
"""Poses at a time: their work arrays stay in the processor's cache."""

_EXACT_ERROR, _REFINED_ERROR = 1e-13, 1e-5
"""m and rad; branches with an error between these are refined."""

_REFINEMENTS = 4

_SINGULAR = 1e-6
"""Measure below which shoulder, elbow or wrist is singular."""


@dataclass(frozen=True, eq=False)
class Solutions:
    """All branches of N poses.

    Attributes:
        q: (N, 8, 6), rad, in (-pi, pi], without regard to limits. An invalid branch holds its nearest miss: the wrist
            point moved to the edge of the reach, the orientation kept.
        valid: (N, 8), whether the pose is met within `ACCURACY`.
        error: (N, 8, 2), distance (m) and angle (rad) by forward kinematics.
        singular: (N, 8, 3), whether shoulder, elbow and wrist are singular: two branches meet, or a joint is free and
            q is one representative.
        branches: names of the eight branches.
    """

    q: Array
    valid: Flags
    error: Array
    singular: Flags
    branches: tuple[str, ...]


class _Branches(NamedTuple):
    """Angles (N, 8, 6), errors (N, 8, 2) and measures of singularity (N, 8, 3) of N poses, or of chosen branches."""

    q: Array
    error: Array
    measures: Array

    def put(self, place: slice | tuple[Index, Index], found: "_Branches") -> None:
        """Write branches at `place`."""
        for whole, part in zip(self, found, strict=True):
            whole[place] = part


class ClosedForm:
    """Inverse kinematics of one frame of one arm."""

    def __init__(self, model: pin.Model, frame: str, geometry: ArmGeometry) -> None:
        self.geometry = geometry
        self.branches = branch_names(geometry)
        self._kinematics = BatchKinematics(model)
        self._X_6T = np.array(model.frames[model.getFrameId(frame)].placement.homogeneous)

    def solve(self, X_WT: Array) -> Solutions:
        """Return all branches of poses X_WT (N, 4, 4) of the frame in the robot's base frame (the root of the model).

        Raises:
            ValueError: another shape, or a rotation that is not orthonormal to 1e-9.
        """
        X_WT = np.asarray(X_WT, float)
        if X_WT.ndim != 3 or X_WT.shape[1:] != (4, 4):
            raise ValueError(f"found poses of shape {X_WT.shape}; expected (N, 4, 4)")
        R = X_WT[:, :3, :3]
        if not np.abs(R.transpose(0, 2, 1) @ R - np.eye(3)).max(initial=0.0) <= ACCURACY:
            raise ValueError("found a rotation matrix that is not orthonormal; expected R^T R = I to 1e-9")
        N = len(X_WT)
        found = _Branches(np.empty((N, 8, 6)), np.empty((N, 8, 2)), np.empty((N, 8, 3)))
        for k in range(0, N, _BLOCK):
            found.put(slice(k, k + _BLOCK), self._block(X_WT[k : k + _BLOCK]))
        valid, singular = found.error.max(-1) <= ACCURACY, found.measures < _SINGULAR
        return Solutions(found.q, valid, found.error, singular, self.branches)

    def _block(self, X: Array) -> _Branches:
        q, measures = self._angles(X[:, None], SIGNS)
        placed = self.forward(q.reshape(-1, 6)).reshape(*q.shape[:2], 4, 4)
        found = _Branches(q, pose_errors(placed, X[:, None]), measures)
        worst = found.error.max(-1)
        rows, columns = np.nonzero((worst > _EXACT_ERROR) & (worst < _REFINED_ERROR))
        if len(rows):
            self._refine(X[rows], SIGNS[:, columns], found, (rows, columns))
        return found

    def _refine(self, X: Array, signs: Array, result: _Branches, at: tuple[Index, Index]) -> None:
        """Correct branches for the deviation of the true arm from the ideal one.

        The angles in a robot file are rounded, so F(q) = F_ideal(q) E(q) with E near the identity. Solving
        F_ideal(q) = Y and then setting Y := X E(q)^-1 = X F(q)^-1 Y converges at once. It also converges at
        singularities, where steps by the Jacobian do not.
        """
        aim = X @ inverse_poses(self.forward(result.q[at])) @ X
        for _ in range(_REFINEMENTS):
            new, new_measures = self._angles(aim, signs)
            placed = self.forward(new)
            new_error = pose_errors(placed, X)
            better = new_error.max(-1) < result.error[at].max(-1)
            chosen = _Branches(new[better], new_error[better], new_measures[better])
            result.put((at[0][better], at[1][better]), chosen)
            aim = X @ inverse_poses(placed) @ aim

    def _angles(self, X: Array, signs: Array) -> tuple[Array, Array]:
        """Return angles (..., 6) and measures of singularity (..., 3) on branches `signs` (3, ...) of poses X."""
        g = self.geometry
        seen = g.R_WA.T @ X[..., :3, :3] @ g.in_tool
        point = seen[..., 3] + (X[..., :3, 3] - g.p_WA) @ g.R_WA
        places = Places(seen[..., 0], seen[..., 1], seen[..., 2], point)
        return (spherical_wrist if g.spherical else three_parallel)(g, places, signs)

    def forward(self, Q: Array) -> Array:
        """Return X_WT (N, 4, 4) at configurations Q (N, 6)."""
        return np.asarray(self._kinematics.poses(Q)[:, 6] @ self._X_6T)


_known: "WeakKeyDictionary[pin.Model, dict[str, ClosedForm | None]]" = WeakKeyDictionary()
"""By frame, of each model in use: models of robots never change."""


def closed_form(robot: Robot, frame: str | None = None) -> ClosedForm | None:
    """Return the closed form of a frame, by default the tool; None for an arm without a closed form."""
    return closed_form_of(robot.model, frame or robot.tool_frame)


def closed_form_of(model: pin.Model, frame: str) -> ClosedForm | None:
    """Return the closed form of a pinocchio model alone."""
    known = _known.setdefault(model, {})
    if frame not in known:
        geometry = recognise(model, frame)
        known[frame] = None if geometry is None else ClosedForm(model, frame, geometry)
    return known[frame]
