"""The report's resolved-rate scheme for screw motion, corrected: a baseline of the comparison.

Every step has an aim C, the share τ along the screw from the tool's pose A to the goal. The change of position and
quaternion from A to C gives a twist, the twist gives joint rates, and the step is β times these.

Source: a course report on screw linear interpolation for Baxter; its errors: docs/theory/reports.md.
"""

from collections.abc import Callable

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.geometry.dual_quaternion import DualQuaternion
from optiplan.planners.sclerp.bounded_least_squares import bounded_least_squares
from optiplan.planners.sclerp.options import SclerpOptions
from optiplan.planners.sclerp.screw_kinematics import ScrewTool
from optiplan.records import dataclass

REFLECTION = 1.1
_LEAST_MOTION = 1e-10  # weight of |dq|² beside the squared error of the twist, so that one dq is the best


@dataclass(frozen=True, eq=False)
class SchemeResult:
    """Result of a scheme.

    Attributes:
        Q: (k + 1, n), configurations from the start on, rad or m.
        error: largest difference of an element of the tool's pose matrix from the goal's, m or 1.
        converged: whether that is within the tolerance.
        hits: (k, n) of bool: which joints each step carried to their limits or past them.
    """

    Q: Array
    error: float
    converged: bool
    hits: np.ndarray[tuple[int, int], np.dtype[np.bool_]]

    @property
    def iterations(self) -> int:
        """Steps taken."""
        return len(self.Q) - 1


def iterate_scheme(
    tool: ScrewTool, start: Array, X_WG: pin.SE3, options: SclerpOptions, stop: Callable[[], bool] = lambda: False
) -> SchemeResult:
    """Step from start (n,) until the tool is at the goal, the iterations are used up or `stop` says so.

    Raises:
        LinAlgError: J_s J_sᵀ has no inverse: the arm is singular, or has fewer than six joints.
    """
    goal, limits = DualQuaternion.from_pose(X_WG), tool.robot.limits
    q, Q = np.array(start, float), [np.array(start, float)]
    hits: list[Array] = []
    while True:
        X_WT, J = tool.at(q)
        error = float(np.abs(X_WG.homogeneous - X_WT.homogeneous).max())
        if error <= options.tolerance or len(hits) == options.iterations or stop():
            break
        q = q + _joint_step(tool, q, J, options.beta * aim(X_WT, goal, options.tau), options)
        hits.append(np.asarray((q >= limits.upper) | (q <= limits.lower)))
        if options.joint_limits == "reflect":
            q = reflected(q, limits.lower, limits.upper)
        elif options.joint_limits == "clip":
            q = np.clip(q, limits.lower, limits.upper)
        Q.append(q)
    return SchemeResult(np.array(Q), error, error <= options.tolerance, np.array(hits, dtype=bool).reshape(-1, len(q)))


def aim(X_WT: pin.SE3, goal: DualQuaternion, tau: float) -> Array:
    """Spatial twist (6,), m and rad, that should carry the tool the share τ along the screw to the goal's pose.

    (v, w) = [[I, 2 p̂ J1], [0, 2 J1]] (Δp, ΔQ), with p the tool's position, Q its quaternion and Δ their changes.
    """
    A = DualQuaternion.from_pose(X_WT)
    C = A.towards(goal, tau)
    change = C.real - A.real if A.real @ C.real >= 0.0 else -C.real - A.real
    p = X_WT.translation
    return np.asarray(rates_to_twist(p, spatial_J1(A.real)) @ np.concatenate([C.position - p, change]))


def rates_to_twist(p: Array, J1: Array) -> Array:
    """[[I, 2 p̂ J1], [0, 2 J1]] (6, 7), p̂ the matrix of p x."""
    matrix = np.zeros((6, 7))
    matrix[0, 0] = matrix[1, 1] = matrix[2, 2] = 1.0
    matrix[:3, 3:] = 2.0 * (pin.skew(p) @ J1)
    matrix[3:, 3:] = 2.0 * J1
    return matrix


def spatial_J1(Q: Array) -> Array:
    """J1 (3, 4) with the angular velocity in world axes w = 2 J1 Q̇, for a unit quaternion Q (4,), scalar first."""
    q0, q1, q2, q3 = Q
    return np.array([[-q1, q0, -q3, q2], [-q2, q3, q0, -q1], [-q3, -q2, q1, q0]])


def reflected(q: Array, low: Array, high: Array) -> Array:
    """Past a limit by x: back by 1.1 x, hence inside by 0.1 x (the report says "within 10 % of the limit")."""
    q = np.where(q >= high, q - REFLECTION * (q - high), q)
    return np.where(q <= low, q + REFLECTION * (low - q), q)


def _joint_step(tool: ScrewTool, q: Array, J: Array, twist: Array, options: SclerpOptions) -> Array:
    """Change of the joints (n,) for a twist: Jᵀ (J Jᵀ + λ² I)⁻¹ twist, or the best within limits."""
    damping = options.damping**2 if options.scheme == "damped" else 0.0
    if options.joint_limits == "qp":
        limits = tool.robot.limits
        longest = options.step * limits.velocity / limits.velocity.max()
        bounds = np.clip(limits.lower - q, -longest, 0.0), np.clip(limits.upper - q, 0.0, longest)
        return bounded_least_squares(J, twist, bounds, np.zeros(len(q)), max(damping, _LEAST_MOTION))
    return _least_motion(J, twist, damping)


def _least_motion(J: Array, right: Array, damping: float = 0.0) -> Array:
    """Jᵀ (J Jᵀ + λ² I)⁻¹ right, with the damping λ²."""
    return np.asarray(J.T @ np.linalg.solve(J @ J.T + damping * np.eye(6), right))
