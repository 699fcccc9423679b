"""Singularities of six-joint arms by name: shoulder, elbow, wrist, the factors of the Jacobian's determinant."""

from typing import Literal

import numpy as np

from optiplan.arrays import Array
from optiplan.kinematics.ik.arm_recognition import recognise
from optiplan.records import dataclass
from optiplan.robot.robot import Robot

Wrist = Literal["spherical", "parallel"]
NAMES = ("shoulder", "elbow", "wrist")


@dataclass(frozen=True, eq=False)
class Factors:
    """The determinant of J (6 x 6) as a product, det J = ± shoulder · elbow · wrist, each factor of shape (N,).

    Attributes:
        shoulder: z_2 . (z_1 x (c - o_1)), m: distance of the wrist's centre c from the plane of axis 1 and z_2.
        elbow: z_2 . ((e - o_2) x (e - o_3)), m²: twice the area of the triangle of axis 2, axis 3 and the elbow's far
            end e.
        wrist: z_4 . (z_5 x z_6).
        length: (N,) m, upper arm plus forearm as seen along z_2; `sines` are relative to it.
        sines: (N, 3) the same three without unit: shoulder / length, the sine of the elbow's angle, wrist.
    """

    shoulder: Array
    elbow: Array
    wrist: Array
    length: Array
    sines: Array

    def names(self, tolerance: float = 1e-3) -> list[tuple[str, ...]]:
        """For every configuration the singularities whose factor is at most `tolerance`, as a sine."""
        near = np.abs(self.sines) <= tolerance
        return [tuple(name for name, hit in zip(NAMES, row, strict=True) if hit) for row in near]


@dataclass(frozen=True, eq=False)
class Blocks:
    """The two blocks of the Jacobian seen from the centre c of a spherical wrist, at N configurations.

    Attributes:
        arm: (N, 3, 3) m/rad, column j is z_j x (c - o_j): velocity of c by joints 1 to 3.
        wrist: (N, 3, 3), columns z_4, z_5, z_6: angular velocity of the hand by joints 4 to 6.
        centre: (N, 3) c in the world, m.
    """

    arm: Array
    wrist: Array
    centre: Array


class SingularityModel:
    """The factors of an arm with six revolute joints whose axes 2 and 3 are parallel, of one of two kinds.

    "spherical": axes 4, 5 and 6 meet in c, and e = c (SRRA, PUMA 560). "parallel": axis 4 is parallel to 2 and 3, axes
    5 and 6 meet in c, and e is a point of axis 4 (UR). Seen from c the Jacobian is block triangular, hence the product.
    Source: Gottlieb, "Robots and Topology", ICRA 1986, for the idea; checked against det J in the tests.
    """

    def __init__(self, robot: Robot, wrist: Wrist) -> None:
        self.wrist = wrist
        self._kinematics = robot.kinematics

    def factors(self, Q: Array) -> Factors:
        """Factors at Q (N, 6)."""
        axis, point = self._kinematics.axes(self._kinematics.poses(Q))
        z1, z2, z4, z5, z6 = (axis[:, k] for k in (0, 1, 3, 4, 5))
        centre = _wrist_centre(axis, point)
        end = centre if self.wrist == "spherical" else point[:, 3]
        upper, fore = _across(point[:, 2] - point[:, 1], z2), _across(end - point[:, 2], z2)
        shoulder = _dot(z2, np.cross(z1, centre - point[:, 0]))
        elbow = _dot(z2, np.cross(upper + fore, fore))
        wrist = _dot(z4, np.cross(z5, z6))
        a, b = np.linalg.norm(upper, axis=1), np.linalg.norm(fore, axis=1)
        sines = np.stack([shoulder / (a + b), elbow / (a * b), wrist], axis=1)
        return Factors(shoulder, elbow, wrist, a + b, sines)

    def blocks(self, Q: Array) -> Blocks:
        """Blocks at Q (N, 6): |det J| = |det arm| |det wrist|, since joints 4 to 6 do not move c.

        Raises:
            ValueError: axes 4, 5 and 6 do not meet.
        """
        if self.wrist != "spherical":
            raise ValueError("the wrist's axes do not meet: joint 4 moves its centre")
        axis, point = self._kinematics.axes(self._kinematics.poses(Q))
        centre = _wrist_centre(axis, point)
        arm = np.cross(axis[:, :3], centre[:, None] - point[:, :3])
        return Blocks(arm.swapaxes(1, 2), axis[:, 3:6].swapaxes(1, 2), centre)


def singularity_model(robot: Robot) -> SingularityModel | None:
    """The model of an arm of one of the two families that `arm_recognition.recognise` knows; None for any other arm."""
    geometry = recognise(robot.model, robot.tool_frame)
    return None if geometry is None else SingularityModel(robot, "spherical" if geometry.spherical else "parallel")


def _wrist_centre(axis: Array, point: Array) -> Array:
    """The point c (N, 3) of axis 5 that is nearest to axis 6."""
    normal = np.cross(axis[:, 4], axis[:, 5])
    along = _dot(np.cross(point[:, 5] - point[:, 4], axis[:, 5]), normal) / _dot(normal, normal)
    return np.asarray(point[:, 4] + along[:, None] * axis[:, 4])


def _across(vector: Array, axis: Array) -> Array:
    """The part of vectors (N, 3) that is perpendicular to unit vectors (N, 3)."""
    return np.asarray(vector - _dot(vector, axis)[:, None] * axis)


def _dot(a: Array, b: Array) -> Array:
    return np.asarray(np.einsum("ni,ni->n", a, b))
