"""The scheme of the Baxter report as printed: its J1, its pure translations.

What is wrong in it: docs/theory/reports.md. Put right it is the scheme `corrected` of the planner `sclerp`.
"""

import math

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.geometry.dual_quaternion import DualQuaternion
from optiplan.planners.sclerp.options import SclerpOptions
from optiplan.planners.sclerp.schemes import SchemeResult, rates_to_twist, reflected
from optiplan.planners.sclerp.screw_kinematics import ScrewTool

PRINTED = SclerpOptions(scheme="corrected", limits="reflect")
"""Shares, tolerance and steps of the report's program; these it shares with `corrected`."""


def printed_scheme(tool: ScrewTool, start: Array, X_WG: pin.SE3, options: SclerpOptions = PRINTED) -> SchemeResult:
    """`schemes.iterate_scheme` with the misprints: B(θ) with the printed J1, aimed along the printed screw."""
    goal, limits = DualQuaternion.from_pose(X_WG), tool.robot.limits
    q, Q, hits = np.array(start, float), [np.array(start, float)], []
    while True:
        X_WT, J = tool.at(q)
        error = float(np.abs(X_WG.homogeneous - X_WT.homogeneous).max())
        if error <= options.tolerance or len(hits) == options.iterations:
            break
        twist = options.beta * printed_aim(X_WT, goal, options.tau)
        q = q + J.T @ np.linalg.solve(J @ J.T, twist)
        hits.append((q >= limits.upper) | (q <= limits.lower))
        q = reflected(q, limits.lower, limits.upper)
        Q.append(q)
    return SchemeResult(np.array(Q), error, error <= options.tolerance, np.array(hits, dtype=bool).reshape(-1, len(q)))


def printed_aim(X_WT: pin.SE3, goal: DualQuaternion, tau: float) -> Array:
    """Spatial twist (6,), m and rad, as in `schemes.aim`, with the printed J1 and screw."""
    A = DualQuaternion.from_pose(X_WT)
    C = report_screw(A, goal, tau)
    change = C.real - A.real if A.real @ C.real >= 0.0 else -C.real - A.real
    p = X_WT.translation
    return np.asarray(rates_to_twist(p, report_J1(A.real)) @ np.concatenate([C.position - p, change]))


def report_J1(Q: Array) -> Array:
    """J1 as the report prints it: 2 J1 Q̇ is the angular velocity in *body* axes, right only where Q turns about w."""
    q0, q1, q2, q3 = Q
    return np.array([[-q1, q0, q3, -q2], [-q2, -q3, q0, q1], [-q3, q2, -q1, q0]])


def report_screw(A: DualQuaternion, B: DualQuaternion, tau: float) -> DualQuaternion:
    """The pose at the share τ from A to B as the report has it: right but for pure translations.

    With t and (θ, u) translation and rotation of A⁻¹ B: d = t · u, m = ½ (t x u + (t - d u) cot(θ/2)), and
    (A⁻¹ B)^τ = (cos τθ/2, sin(τθ/2) u) + ε (-τd/2 sin τθ/2, τd/2 cos(τθ/2) u + sin(τθ/2) m). For θ = 0, tested exactly,
    u is the direction of p_B - p_A in *world* axes, although t is in those of A, and m = ½ t x u.
    """
    D = (A.conjugate * B).shorter()
    t, sine = D.position, math.hypot(*D.real[1:])
    half = math.atan2(sine, D.real[0])
    if half == 0.0:
        way = B.position - A.position
        u = way / max(float(np.linalg.norm(way)), 1e-300)
        d, m = float(t @ u), 0.5 * pin.skew(t) @ u
    else:
        u = D.real[1:] / sine
        d = float(t @ u)
        m = 0.5 * (pin.skew(t) @ u + (t - d * u) / math.tan(half))
    c, s, e = math.cos(tau * half), math.sin(tau * half), 0.5 * tau * d
    return A * DualQuaternion(np.array([c, *(s * u)]), np.array([-e * s, *(e * c * u + s * m)]))
