"""Forward kinematics of one chain of joints, for many configurations at once."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from optiplan.arrays import Array


class SerialChain:
    """Frame F behind a chain of L joints, revolute or prismatic, each carried by the one before, over N configurations.

    With X_PJ the fixed placement of joint j in its parent and B_j a rotation that takes z to its axis,
    X_WF = K_1 Z(q_1) K_2 Z(q_2) … K_L Z(q_L) K_F, where K_j = B_P^T X_PJ B_j, K_F = B_L^T X_LF, and Z(q) turns about z
    or slides along it. So a joint takes one product with a constant matrix for all N at once.

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
