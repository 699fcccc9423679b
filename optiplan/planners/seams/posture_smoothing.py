"""Smooth a posture along a path: joints move as evenly as they can while the tool stays in place.

Over the time that the speed gives to each station, the sum of squares of joint speeds, accelerations and jerks, each as
a share of its limit, is made small (Gauss-Newton). Steps lie in what the path leaves free, and the tool is put in place
after each. Joints near their limits, axes near the edge of their cone, and peaks count more from step to step.
"""

from typing import TYPE_CHECKING

import numpy as np

from optiplan.arrays import Array, Flags
from optiplan.libraries import loading
from optiplan.planners.seams.seam_tool import SeamTool, ToolPlaces
from optiplan.problem.problem import Problem
from optiplan.records import dataclass

if TYPE_CHECKING:
    import scipy.sparse as sp

_WEIGHTS = 0.3, 1.0, 1.0
"""Of speeds, accelerations and jerks, as shares of their limits."""

_SHORT = 0.1
"""s: the jerk that counts at least takes the acceleration limit in this time."""

_MARGIN, _AT_LIMIT = 0.04, 30.0
"""Share of a joint's range next to its limits that is kept free, and the weight of that."""

_EDGE, _TILTED = 0.9, 10.0
"""Share of the cone within which the axis is kept, and the weight of that, per rad."""

_UPRIGHT = 0.05
"""Weight of tilts within the cone, per rad."""

_LONGEST = 0.15
"""rad or m, of a joint in one step."""

_CONVERGED = 1e-4
"""rad or m: steps that are shorter change nothing."""

_PEAK = 0.5
"""Share of a limit from which on it counts more and more."""


@dataclass(frozen=True, eq=False)
class Stations:
    """Stations of a path: lengths s (N,), m, places of the tool, and at which (N,) there is a corner."""

    at: ToolPlaces
    corner: Flags

    @property
    def s(self) -> Array:
        """Lengths (N,), m."""
        return self.at.s


class PostureSmoothing:
    """Differences of configurations at stations as sparse matrices, and the steps that make them small."""

    def __init__(self, problem: Problem, tool: SeamTool, stations: Stations) -> None:
        self.problem, self.tool, self.stations = problem, tool, stations
        t = stations.s / tool.path.speed
        h = np.diff(t)
        self._orders = _differences(t, stations.corner)
        limits = problem.limits
        jerk = np.minimum(limits.jerk, limits.acceleration / _SHORT)
        self._limits = limits.velocity, limits.acceleration, jerk
        self._step = float(h.mean())

    def smooth(self, Q: Array, rounds: int, anchor: float = 0.0) -> Array:
        """Return configurations (N, n) near Q, smoother, with the tool in place at every station.

        `anchor` weighs how far they are from Q, as shares of a second's way.
        """
        first = Q
        Q, worst = self.tool.corrected(Q, self.stations.at, 12)
        for _ in range(rounds):
            step = self._newton(Q, first, anchor)
            size = float(np.abs(step).max())
            new, worst = self.tool.corrected(Q + step * min(1.0, _LONGEST / max(size, 1e-12)), self.stations.at, 12)
            if worst.max() > 1e-6:
                break
            Q = new
            if size < _CONVERGED:
                break
        return Q

    def shares(self, Q: Array) -> list[Array]:
        """Return speeds, accelerations and jerks at their places, (…, n) each, as shares of their limits."""
        return [np.abs(D @ Q) / limit for (D, _), limit in zip(self._orders, self._limits, strict=True)]

    def _newton(self, Q: Array, first: Array, anchor: float) -> Array:
        """Return the step (N, n) that makes the squares small to first order."""
        N, n = Q.shape
        rows = self.tool.rows(Q, self.stations.at, self.tool.path.cone)
        free = self.tool.free_motions(rows.J[:, : self.tool.equalities])
        r = free.shape[2]
        if r == 0:
            return np.zeros_like(Q)
        with loading():
            import scipy.sparse as sp
            from scipy.sparse.linalg import spsolve
        H = sp.csr_matrix((N * n, N * n))
        g = np.zeros((N, n))
        parts = zip(self._orders, self._limits, _WEIGHTS, strict=True)
        for (D, width), limit, weight in parts:
            value = (D @ Q) / limit
            W = weight * width[:, None] * np.maximum(1.0, np.abs(value) / _PEAK) ** 2
            g += D.T @ (W * value / limit)
            H = H + _spread(D, W / limit**2)
        near, push = self._near_limits(Q)
        g += self._step * (push + anchor * (Q - first) / self.problem.limits.velocity**2)
        own = near + anchor / self.problem.limits.velocity**2 + 1e-9
        H = H + self._step * sp.diags(own.ravel())
        if self.tool.path.cone > 0.0:
            slope, J = self._tilting(Q)
            g += self._step * slope
            H = H + self._step * sp.block_diag(list(np.einsum("nij,nik->njk", J, J)), format="csr")
        columns = np.arange(N)[:, None, None] * r + np.arange(r)
        lines = np.arange(N)[:, None, None] * n + np.arange(n)[:, None]
        Z = sp.csr_matrix(
            (free.ravel(), (np.broadcast_to(lines, free.shape).ravel(), np.broadcast_to(columns, free.shape).ravel())),
            shape=(N * n, N * r),
        )
        A = (Z.T @ H @ Z + 1e-10 * sp.identity(N * r)).tocsc()
        z = spsolve(A, -(Z.T @ g.ravel()))
        return np.asarray((Z @ z).reshape(N, n))

    def _near_limits(self, Q: Array) -> tuple[Array, Array]:
        """Return curvature and slope (N, n) of the squares of how far joints are in the margins of their limits."""
        limits = self.problem.limits
        wide = np.where(np.isfinite(limits.upper - limits.lower), limits.upper - limits.lower, np.inf)
        margin = np.where(np.isfinite(wide), _MARGIN * wide, 0.0)
        over = np.maximum(Q - (limits.upper - margin), 0.0) - np.maximum(limits.lower + margin - Q, 0.0)
        weight = _AT_LIMIT * (over != 0.0)
        return weight, weight * over

    def _tilting(self, Q: Array) -> tuple[Array, Array]:
        """Return the slope (N, n) of the squares of tilts, and the weighted Jacobian (N, m, n) of them."""
        rows = self.tool.rows(Q, self.stations.at, 0.0)
        tilt, e, J = rows.tilt, rows.e[:, 3:], rows.J[:, 3:]
        edge = _EDGE * self.tool.path.cone
        slope = -_UPRIGHT * np.einsum("nij,ni->nj", J, e)
        beyond = np.maximum(tilt - edge, 0.0) / np.maximum(tilt, 1e-12)
        slope -= _TILTED**2 * np.einsum("nij,ni->nj", J, e * beyond[:, None])
        weight = np.sqrt(_UPRIGHT + _TILTED**2 * (beyond > 0.0))
        return slope, J * weight[:, None, None]


def _differences(t: Array, corner: Flags) -> "list[tuple[sp.csr_matrix, Array]]":
    """Return first, second and third divided differences over times t (N,), s, as matrices, and the time of each, s.

    Second and third ones do not reach across corners, where the arm stops.
    """
    with loading():
        import scipy.sparse as sp

    N = len(t)
    h = np.diff(t)
    first = sp.diags([-1.0 / h, 1.0 / h], [0, 1], shape=(N - 1, N)).tocsr()
    middle = 0.5 * (t[1:] + t[:-1])
    found = [(first, h)]
    inner = ~corner[1:-1]
    width = np.diff(middle)
    second = sp.diags([-1.0 / width, 1.0 / width], [0, 1], shape=(N - 2, N - 1)).tocsr() @ first
    found.append((second[inner], width[inner]))
    both = inner[1:] & inner[:-1]
    wide = np.diff(t[1:-1])
    third = sp.diags([-1.0 / wide, 1.0 / wide], [0, 1], shape=(max(N - 3, 0), N - 2)).tocsr() @ second
    found.append((third[both], wide[both]))
    return found


def _spread(D: "sp.csr_matrix", W: Array) -> "sp.csr_matrix":
    """Return sum over joints of D^T diag(W_j) D in the order of stations and then joints, (N n, N n)."""
    with loading():
        import scipy.sparse as sp

    n = W.shape[1]
    blocks = []
    for j in range(n):
        own = sp.coo_matrix(D.T @ sp.diags(W[:, j]) @ D)
        blocks.append((own.data, own.row * n + j, own.col * n + j))
    data, row, column = (np.concatenate([block[k] for block in blocks]) for k in range(3))
    size = D.shape[1] * n
    return sp.csr_matrix((data, (row, column)), shape=(size, size))
