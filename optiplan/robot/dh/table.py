"""Denavit–Hartenberg tables, standard and modified: what a row means, and plain forward kinematics.

Sources: J. Denavit, R. S. Hartenberg, J. Appl. Mech. 22 (1955) (standard, as in Spong, Robot Modeling and Control);
J. J. Craig, Introduction to Robotics (modified).
"""

from typing import Literal

import numpy as np

from optiplan.arrays import Array
from optiplan.records import dataclass

Convention = Literal["standard", "modified"]
JointKind = Literal["revolute", "prismatic"]


@dataclass(frozen=True)
class DhRow:
    """One row: `a` and `d` in m, `alpha` and `theta` in rad; `joint` None makes it a fixed one.

    A revolute joint's q is added to `theta`, a prismatic one's to `d`.
    """

    a: float = 0.0
    alpha: float = 0.0
    d: float = 0.0
    theta: float = 0.0
    joint: JointKind | None = None
    name: str = ""


@dataclass(frozen=True)
class DhTable:
    """A chain of rows; row i leads from frame i - 1 to frame i.

    standard: X = Rz(theta) Tz(d) Tx(a) Rx(alpha); modified: X = Rx(alpha) Tx(a) Rz(theta) Tz(d).
    """

    convention: Convention
    rows: tuple[DhRow, ...]

    @property
    def n(self) -> int:
        """Number of joints."""
        return sum(row.joint is not None for row in self.rows)


def along_x(a: float, alpha: float) -> Array:
    """Tx(a) Rx(alpha) = Rx(alpha) Tx(a), (4, 4): what a row does along and about the x axis."""
    cosine, sine = np.cos(alpha), np.sin(alpha)
    return np.array([[1.0, 0.0, 0.0, a], [0.0, cosine, -sine, 0.0], [0.0, sine, cosine, 0.0], [0.0, 0.0, 0.0, 1.0]])


def along_z(d: Array, theta: Array) -> Array:
    """Rz(theta) Tz(d) = Tz(d) Rz(theta) of N values each, (N, 4, 4): what a row does along and about the z axis."""
    result = np.zeros((len(theta), 4, 4))
    result[:, 0, 0] = result[:, 1, 1] = np.cos(theta)
    result[:, 1, 0] = np.sin(theta)
    result[:, 0, 1] = -result[:, 1, 0]
    result[:, 2, 3] = d
    result[:, 2, 2] = result[:, 3, 3] = 1.0
    return result


def forward(table: DhTable, q: Array) -> Array:
    """Pose X_0E of the last frame of the table in its first.

    Args:
        table: with n joints.
        q: (n,) or (N, n), rad and m.

    Returns:
        (4, 4) or (N, 4, 4).
    """
    last: Array = frames(table, q)[..., -1, :, :]
    return last


def frames(table: DhTable, q: Array) -> Array:
    """Poses X_0i of all frames of the table, the first included, for q (n,) or (N, n): (rows + 1, 4, 4) or (N, …)."""
    Q = np.atleast_2d(np.asarray(q, dtype=np.float64))
    if Q.shape[-1] != table.n:
        raise ValueError(f"found {Q.shape[-1]} joint values; expected {table.n}")
    result = np.empty((len(Q), len(table.rows) + 1, 4, 4))
    result[:, 0] = np.eye(4)
    column = 0
    for i, row in enumerate(table.rows):
        d, theta = np.full(len(Q), row.d), np.full(len(Q), row.theta)
        if row.joint == "revolute":
            theta = theta + Q[:, column]
        elif row.joint == "prismatic":
            d = d + Q[:, column]
        column += row.joint is not None
        z, x = along_z(d, theta), along_x(row.a, row.alpha)
        result[:, i + 1] = result[:, i] @ (z @ x if table.convention == "standard" else x @ z)
    return result if np.ndim(q) == 2 else result[0]
