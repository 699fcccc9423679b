"""Recognise arms whose inverse kinematics has a closed form, by the lines of their joint axes.

Two families, both with joint 2 parallel to joint 3 and square to joint 1:

- *spherical wrist*: axes 4, 5, 6 meet in one point, 4 square to 5 and 5 to 6 (PUMA 560, SRRA, most industrial arms);
- *three parallel axes*: 2, 3, 4 parallel, 5 square to 4 and 6 square to 5, axes 5 and 6 meet (Universal Robots).

Everything is written in the arm frame A: z along axis 1, y along axis 2, origin on axis 1 at the height of axis 2, all
at q = 0. A point of the x-z plane is the complex number z + i x; a rotation by q about y is the factor exp(i q).
Source of the conditions: Pieper, "The kinematics of manipulators under computer control", Stanford, 1968.
"""

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.records import dataclass
from optiplan.robot.batched.kinematics import BatchKinematics

TOLERANCE = 1e-6
"""Deviation from parallel or square axes, rad, and from intersecting axes, m, below which they count as such."""


@dataclass(frozen=True, eq=False)
class ArmGeometry:
    """An arm of one of the two families, at q = 0.

    The *wrist point* P is where axes 4, 5, 6 (three parallel axes: 5 and 6) meet.

    Attributes:
        spherical: a spherical wrist; else three parallel axes.
        R_WA: (3, 3) orientation of A in the world.
        p_WA: (3,) origin of A in the world, m.
        in_tool: (3, 4) in the tool frame: directions of axis 6, of axis 5, of 5 x 6 (unit), and P (m).
        lateral: coordinate of P along y of A, m: the same whatever joints 2, 3 and 4 do.
        shoulder: axis 2 in the x-z plane, m.
        upper: from axis 2 to axis 3, m.
        fore: from axis 3 to P (three parallel axes: to axis 4), m.
        hand: three parallel axes: from axis 4 to P, m; else 0.
        signs: (2,) whether axes 3 and 4 point along (1) or against (-1) axis 2; that of 4 has no meaning on a wrist.
        wrist: (3, 3) directions 5 x 4, 5, 4 of a spherical wrist, as columns, in A; the identity else.
        zero: angle of axis 6 about axis 5 at q5 = 0, rad: from axis 4 on.
        five: angle about y of axis 5, rad; three parallel axes only.
    """

    spherical: bool
    R_WA: Array
    p_WA: Array
    in_tool: Array
    lateral: float
    shoulder: complex
    upper: complex
    fore: complex
    hand: complex
    signs: Array
    wrist: Array
    zero: float
    five: float


def recognise(model: pin.Model, frame: str) -> ArmGeometry | None:
    """Return the geometry of a chain of six revolute joints and a frame on the last one; None for other arms."""
    if model.nv != 6 or model.njoints != 7 or any(int(model.parents[j]) != j - 1 for j in range(1, 7)):
        return None
    kinematics = BatchKinematics(model)
    if not kinematics.revolute.all() or model.frames[model.getFrameId(frame)].parentJoint != 6:
        return None
    poses = kinematics.poses(np.zeros((1, 6)))
    w, p = (part[0] for part in kinematics.axes(poses))
    if not (_square(w[0], w[1]) and _parallel(w[1], w[2])):
        return None
    X_WT = pin.SE3(poses[0, 6]) * model.frames[model.getFrameId(frame)].placement
    wrist_point, miss = _meeting(w[3:], p[3:])
    if miss < TOLERANCE:
        return _measure(w, p, wrist_point, X_WT, True) if _square(w[3], w[4]) and _square(w[4], w[5]) else None
    wrist_point, miss = _meeting(w[4:], p[4:])
    suits = _parallel(w[1], w[3]) and _square(w[3], w[4]) and _square(w[4], w[5]) and miss < TOLERANCE
    return _measure(w, p, wrist_point, X_WT, False) if suits else None


def _measure(w: Array, p: Array, P: Array, X_WT: pin.SE3, spherical: bool) -> ArmGeometry | None:
    z = w[0]
    y = _unit(w[1] - z * (z @ w[1]))
    R_WA = np.column_stack([np.cross(y, z), y, z])
    p_WA = p[0] + z * (z @ (p[1] - p[0]))
    lines, points = w @ R_WA, (p - p_WA) @ R_WA  # in A from here on
    end = (P - p_WA) @ R_WA
    four = np.array([0.0, 1.0, 0.0]) if not spherical else lines[3]
    five = _unit(lines[4] - four * (four @ lines[4]))
    six = _unit(lines[5] - five * (five @ lines[5]))
    cross = np.cross(five, four)
    to_tool = X_WT.rotation.T @ R_WA
    joint_3, joint_4 = _plane(points[2]), _plane(points[3])
    forearm_end = _plane(end) if spherical else joint_4
    geometry = ArmGeometry(
        spherical=spherical,
        R_WA=R_WA,
        p_WA=p_WA,
        in_tool=np.column_stack(
            [*(to_tool @ v for v in (six, five, np.cross(five, six))), X_WT.rotation.T @ (P - X_WT.translation)]
        ),
        lateral=float(end[1]),
        shoulder=_plane(points[1]),
        upper=joint_3 - _plane(points[1]),
        fore=forearm_end - joint_3,
        hand=_plane(end) - forearm_end,
        signs=np.sign(lines[2:4, 1]),
        wrist=np.column_stack([cross, five, four]) if spherical else np.eye(3),
        zero=float(np.arctan2(cross @ six, four @ six)),
        five=float(np.angle(_plane(five))),
    )
    long_enough = min(abs(geometry.upper), abs(geometry.fore), np.inf if spherical else abs(geometry.hand)) > TOLERANCE
    return geometry if long_enough else None


def _plane(v: Array) -> complex:
    return complex(v[2], v[0])


def _unit(v: Array) -> Array:
    return np.asarray(v / np.linalg.norm(v))


def _parallel(a: Array, b: Array) -> bool:
    return bool(np.linalg.norm(np.cross(a, b)) < TOLERANCE)


def _square(a: Array, b: Array) -> bool:
    return abs(float(a @ b)) < TOLERANCE


def _meeting(directions: Array, points: Array) -> tuple[Array, float]:
    """Return the least-squares nearest point of lines (k, 3), and its distance from the farthest of them, m."""
    across = np.eye(3) - directions[:, :, None] * directions[:, None, :]
    middle = np.linalg.lstsq(across.sum(0), np.einsum("kij,kj->i", across, points), rcond=None)[0]
    return middle, float(np.linalg.norm(np.einsum("kij,kj->ki", across, middle - points), axis=1).max())
