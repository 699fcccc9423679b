"""The limits along a path as functions of s(t) and its derivatives, with their gradients, at samples of a time law."""

from typing import NamedTuple

import numpy as np

from optiplan.arrays import Array, Index
from optiplan.robot.robot import Limits
from optiplan.trajectory import bspline
from optiplan.trajectory.timing.path_constraints import Rows
from optiplan.trajectory.trajectory import Trajectory

_INSIDE = np.array([0.0, 0.5, 1.0])  # where each span is sampled: the jerk on both sides of a knot


class Block(NamedTuple):
    """K times m limits |value + offset| <= bound; run tau times slower the value is divided by tau^power.

    Attributes:
        power: 1 for speeds, 2 for accelerations and torques, 3 for jerks.
        sample: (K,) which samples.
        value: (K, m).
        offset: (K, m), what does not change with time: gravity.
        bound: (m,).
        gradient: of value + offset by s, s', s'' and s''', each (K, m).
    """

    power: int
    sample: Index
    value: Array
    offset: Array
    bound: Array
    gradient: tuple[Array, Array, Array, Array]

    def slowness(self) -> float:
        """The smallest tau >= 0 at which all of them hold: max ((value / (bound -+ offset))^(1 / power))."""
        worst = 0.0
        for sign in (1.0, -1.0):
            share = sign * self.value / np.maximum(self.bound - sign * self.offset, 1e-3 * self.bound)
            worst = max(worst, float(share.max()))
        return float(worst ** (1.0 / self.power))


class Basis:
    """Clamped cubic B-splines at three samples of every span: the four that do not vanish, and their derivatives.

    Attributes:
        knots: (N + 4,), s.
        first: (k,) index of the first of the four control points of each sample.
        values: (4, k, 4) by order of the derivative, sample, control point; 1/s^order.
    """

    def __init__(self, breakpoints: Array) -> None:
        t, spans = breakpoints, len(breakpoints) - 1
        self.knots = np.concatenate([t[[0, 0, 0]], t, t[[-1, -1, -1]]])
        pieces = bspline.pieces(self.knots, np.eye(spans + 3), 3)[1]  # (spans, power, control point)
        four = np.arange(spans)[:, None] + np.arange(4)
        local = np.take_along_axis(pieces, four[:, None, :], axis=2)
        powers = (np.diff(t)[:, None] * _INSIDE)[:, :, None] ** np.arange(4)
        values = []
        for _ in range(4):
            values.append(np.einsum("mxp,mpc->mxc", powers[:, :, : local.shape[1]], local).reshape(-1, 4))
            local = local[:, 1:] * np.arange(1.0, local.shape[1])[None, :, None]
        self.first, self.values = np.repeat(np.arange(spans), len(_INSIDE)), np.array(values)

    def __call__(self, control: Array) -> Array:
        """s, s', s'', s''' at the samples, (4, k), for control points (N,)."""
        return np.asarray(np.einsum("okc,kc->ok", self.values, control[self.first[:, None] + np.arange(4)]))

    def slow_down(self, factor: float) -> None:
        """Let time run slower: the same control points, knots farther apart."""
        self.knots = self.knots * factor
        self.values = self.values / factor ** np.arange(4.0)[:, None, None]


class LawLimits:
    """The limits of a robot along one path. What `Rows` has besides joint acceleration is interpolated linearly."""

    def __init__(self, path: Trajectory, limits: Limits, rows: Rows) -> None:
        self._path, self._limits, self._rows = path, limits, rows
        self._extra = rows.A.shape[1] - path.n
        parts = [x[:, path.n :] for x in (rows.A, rows.B, rows.G)] + [1.0 / rows.speed[:, None]]
        self._table = np.hstack(parts)
        self._slope = np.diff(self._table, axis=0) / np.diff(rows.s)[:, None]

    def __call__(self, S: Array) -> list[Block]:
        """All limits for s and its derivatives, S (4, k)."""
        s = np.clip(S[0], 0.0, self._path.duration)
        found, every = [self._acceleration(s, S), self._jerk(S)], np.arange(len(s))
        i = np.clip(np.searchsorted(self._rows.s, s, side="right") - 1, 0, len(self._slope) - 1)
        value = self._table[i] + (s - self._rows.s[i])[:, None] * self._slope[i]
        m = self._extra
        (A, B, G, w), (dA, dB, dG, dw) = (np.split(x, [m, 2 * m, 3 * m], axis=1) for x in (value, self._slope[i]))
        s1, s2 = S[1][:, None], S[2][:, None]
        none = np.zeros_like(w)
        found.append(Block(1, every, w * s1, none, np.ones(1), (dw * s1, w, none, none)))
        if m:
            gradient = (dA * s2 + dB * s1**2 + dG, 2.0 * B * s1, A, np.zeros_like(A))
            found.append(Block(2, every, A * s2 + B * s1**2, G, self._rows.bound[-m:], gradient))
        return found

    def _acceleration(self, s: Array, S: Array) -> Block:
        """Joint acceleration q' s'' + q'' s'^2."""
        q1, q2, q3 = (self._path(s, order) for order in (1, 2, 3))
        s1, s2 = S[1][:, None], S[2][:, None]
        none = np.zeros_like(q1)
        gradient = (q2 * s2 + q3 * s1**2, 2.0 * q2 * s1, q1, none)
        return Block(2, np.arange(len(s)), q1 * s2 + q2 * s1**2, none, self._limits.acceleration, gradient)

    def _jerk(self, S: Array) -> Block:
        """Joint jerk q' s''' + 3 q'' s' s'' + q''' s'^3.

        Where the path's third derivative jumps, the samples before and after have it from both sides.
        """
        inner = self._path.breakpoints[1:-1]
        after = np.clip(np.searchsorted(S[0], inner), 1, S.shape[1] - 1)
        sample = np.concatenate([np.arange(S.shape[1]), after - 1, after - 1, after, after])
        before = np.nextafter(inner, 0.0)
        s = np.clip(np.concatenate([S[0], before, inner, before, inner]), 0.0, self._path.duration)
        q1, q2, q3, q4 = (self._path(s, order) for order in (1, 2, 3, 4))
        s1, s2, s3 = S[1:, sample, None]
        value = q1 * s3 + 3.0 * q2 * s1 * s2 + q3 * s1**3
        by_s = q2 * s3 + 3.0 * q3 * s1 * s2 + q4 * s1**3
        gradient = (by_s, 3.0 * (q2 * s2 + q3 * s1**2), 3.0 * q2 * s1, q1)
        return Block(3, sample, value, np.zeros_like(value), self._limits.jerk, gradient)
