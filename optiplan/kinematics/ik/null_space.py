"""Choose among the solutions of a redundant arm: descent in the null space, at a constant pose."""

import numpy as np

from optiplan.arrays import Array
from optiplan.errors import UnknownChoiceError
from optiplan.kinematics.ik.levenberg_marquardt import Descent
from optiplan.records import dataclass
from optiplan.robot.limits import Limits

AIMS = ("middle", "reference", "manipulability")

_STEPS = 60

_FIRST_STEP, _LONGEST_STEP, _SHORTEST_STEP = 0.2, 0.5, 1e-4
"""rad or m."""

_LEAST_SINGULAR_VALUE = 1e-6
"""Share of the largest singular value; directions below it do not move the frame."""

_LIMIT_SLACK = 1e-6
"""rad or m; a joint nearer to its limit is at the limit."""

_CORRECTIONS = 8
"""Iterations that restore the pose after a step."""


@dataclass(frozen=True, eq=False)
class Preference:
    """Preference among solutions of the same pose, as a cost to minimise.

    `middle`: 1/2 sum ((q_i - m_i) / h_i)^2, with m_i the middle and h_i half the range of joint i; a joint without
    bounds does not count. `reference`: 1/2 |q - reference|^2. `manipulability`: -log sqrt(det(J J^T)) of the frame.

    Attributes:
        aim: one of `AIMS`.
        reference: (n,) for the aim `reference`, rad or m.

    Raises:
        UnknownChoiceError: no such aim.
        ValueError: the aim is `reference` and there is none.
    """

    aim: str
    reference: Array | None = None

    def __post_init__(self) -> None:
        if self.aim not in AIMS:
            raise UnknownChoiceError("preference", self.aim, AIMS)
        if (self.aim == "reference") != (self.reference is not None):
            raise ValueError("the preference 'reference', and no other, needs a reference configuration")

    def cost(self, q: Array, J: Array, limits: Limits) -> tuple[float, Array]:
        """Cost at q (n,) and its gradient (n,); J (m, n) is the Jacobian of the frame in world axes, base to tip."""
        if self.aim == "manipulability":
            return _manipulability(J)
        if self.reference is not None:
            offset, scale = q - self.reference, np.ones(len(q))
        else:
            bounded = np.isfinite(limits.lower) & np.isfinite(limits.upper) & (limits.upper > limits.lower)
            low, high = np.where(bounded, limits.lower, q - 1.0), np.where(bounded, limits.upper, q + 1.0)
            offset, scale = q - (low + high) / 2.0, 2.0 / (high - low)
        return 0.5 * float(((offset * scale) ** 2).sum()), offset * scale**2


def improve(descent: Descent, limits: Limits, q: Array, preference: Preference) -> Array:
    """Return a configuration (n,) with the pose of q (n,), within the limits, at a local minimum of the cost.

    Steps lie in the null space of the frame's Jacobian, along the projected negative gradient. After each, a few steps
    of `descent` restore the pose. A step that does not lower the cost is undone. Without a null space q is returned.
    """
    length = _FIRST_STEP
    J = descent.jacobian(q)
    cost, gradient = preference.cost(q, J, limits)
    for _ in range(_STEPS):
        direction = _downhill(descent, q, J, gradient)
        norm = float(np.linalg.norm(direction))
        if norm < 1e-9 or length < _SHORTEST_STEP:
            break
        # A quadratic cost asks for a step as long as its gradient at most; this saves the last, futile ones.
        step = min(length, norm * 2.0) if preference.aim == "reference" else length
        reach = min(step / norm, descent.distance_to_limits(q, direction))
        trial = descent.descend(q + direction * reach, _CORRECTIONS)
        J_trial = descent.jacobian(trial)
        trial_cost, trial_gradient = preference.cost(trial, J_trial, limits)
        if trial_cost < cost and descent.reached(trial):
            q, J, cost, gradient = trial, J_trial, trial_cost, trial_gradient
            length = min(length * 1.5, _LONGEST_STEP)
        else:
            length *= 0.4
    return q


def _downhill(descent: Descent, q: Array, J: Array, gradient: Array) -> Array:
    """Minus the gradient, projected on the null space of J (m, n); joints that it would push through a limit rest."""
    rest = np.zeros(len(q), dtype=bool)
    direction = -gradient
    for _ in range(len(q)):
        _, s, V = np.linalg.svd(np.where(rest, 0.0, J))
        N = V[int((s > _LEAST_SINGULAR_VALUE * s[0]).sum()) :]
        # What rests is in the null space of the zeroed columns too, and must not come back.
        free = np.where(rest, 0.0, N)
        direction = free.T @ (free @ -gradient)
        pushed = descent.held(q, direction, _LIMIT_SLACK) & (np.abs(direction) > 1e-12)
        if not pushed.any():
            break
        rest |= pushed
    return np.asarray(direction)


def _manipulability(J: Array) -> tuple[float, Array]:
    """-log w with w = sqrt(det(J J^T)), and its gradient -trace(J^+ dJ/dq_j), (n,).

    With (l_i, w_i) the linear and angular part of column i, base to tip,
    d w_i / d q_j = w_j x w_i for j <= i, else 0, and d l_i / d q_j = w_j x l_i for j <= i, else w_i x l_j.
    """
    m, n = J.shape
    gram = J @ J.T
    sign, logarithm = np.linalg.slogdet(gram)
    if m > n or sign <= 0.0:
        return np.inf, np.zeros(n)
    inverse = np.linalg.solve(gram, J).T  # (n, m)
    linear, angular = J[:3].T, J[3:].T if m == 6 else np.zeros((n, 3))
    before = np.tri(n, dtype=bool)[:, :, None]  # [i, j]: j <= i
    d_linear = np.where(before, np.cross(angular[None], linear[:, None]), np.cross(angular[:, None], linear[None]))
    d_angular = np.where(before, np.cross(angular[None], angular[:, None]), 0.0)
    columns = np.concatenate([d_linear, d_angular], axis=2)[:, :, :m]  # [i, j, row]
    return -0.5 * float(logarithm), -np.asarray(np.einsum("ir,ijr->j", inverse, columns))
