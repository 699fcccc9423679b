"""Failures that several planners report."""

from itertools import pairwise
from typing import Any, Literal

import numpy as np

from optiplan.arrays import Array
from optiplan.collision.contacts import Contact
from optiplan.collision.model import CollisionModel
from optiplan.planners.base import Budget, Failure, FailureKind
from optiplan.planners.common.gravity import Gravity
from optiplan.robot.robot import Limits, Robot
from optiplan.trajectory.trajectory import Trajectory

_PATH_SAMPLES = 200
"""Configurations of a path at which gravity is evaluated."""


def contact_witness(q: Array, contact: Contact) -> dict[str, Any]:
    """Return a contact as JSON-ready data: configuration, bodies, nearest points (world, m) and distance (m)."""
    return {
        "q": q.tolist(),
        "pair": [contact.pair.name_a, contact.pair.name_b],
        "points": [contact.point_a.tolist(), contact.point_b.tolist()],
        "distance": contact.bodies_apart,
    }


def end_collides(model: CollisionModel, q: Array, end: Literal["start", "goal"]) -> Failure:
    """Return the failure for a colliding `start` or `goal` configuration q (n,), naming bodies or joint."""
    kind: FailureKind = "start-in-collision" if end == "start" else "goal-in-collision"
    if (beyond := model.beyond_limits(q)) is not None:
        return Failure(kind, f"{end} configuration: {beyond}", {"q": q.tolist()})
    contact = model.clearance(q)
    if contact is None:
        raise ValueError("a model without pairs does not collide")
    detail = f"{end} configuration: {contact.overlap}"
    detail += "" if model.error is None else ", where the joints may be within the tracking error"
    return Failure(kind, detail, contact_witness(q, contact))


def too_heavy(robot: Robot, limits: Limits, waypoints: Array) -> Failure:
    """Return the failure for a free path through waypoints (k, n) on which gravity exceeds the torque limits."""
    gravity = Gravity(robot, limits.torque)
    for end, q in (("start", waypoints[0]), ("goal", waypoints[-1])):
        if gravity.too_much(q):
            return end_too_heavy(gravity, q[None], end)
    Q = np.vstack([waypoints[:1], *(np.linspace(a, b, 50) for a, b in pairwise(waypoints))])
    return _heavy("limits", gravity, Q, "on the free path that was found")


def path_too_heavy(robot: Robot, limits: Limits, path: Trajectory) -> Failure:
    """Return the failure for a free path q(s) on which gravity exceeds the torque limits."""
    return too_heavy(robot, limits, path(np.linspace(0.0, path.duration, _PATH_SAMPLES)))


def end_too_heavy(gravity: Gravity, Q: Array, end: str) -> Failure:
    """Return the failure for gravity above the torque limits at the `start`, or at every `goal`: Q (N, n)."""
    return _heavy("infeasible", gravity, Q, f"at the {end}")


def line_too_heavy(gravity: Gravity, Q: Array, where: str = "along the line") -> Failure | None:
    """Return the failure for gravity above the torque limits at one of the configurations Q (N, n) along a line."""
    return _heavy("limits", gravity, Q, where) if any(map(gravity.too_much, Q)) else None


def _heavy(kind: FailureKind, gravity: Gravity, Q: Array, where: str) -> Failure:
    torques = np.array([gravity.torque(q) for q in Q])
    k, j = np.unravel_index(int(np.argmax(torques / gravity.limit)), torques.shape)
    name, torque, limit = gravity.joint_names[j], float(torques[k, j]), float(gravity.limit[j])
    detail = f"gravity alone exceeds the torque limits {where}: {name} takes {torque:.4g} of {limit:.4g} N·m"
    return Failure(kind, detail, {"q": Q[k].tolist(), "joint": name, "torque": torque})


def out_of_time(budget: Budget, doing: str, earlier: Failure | None = None) -> Failure:
    """Return the failure for a budget that ended, or a cancellation, while `doing` something.

    `earlier` is the first reason for which the search went on until then.
    """
    if budget.cancelled:
        return with_reason(Failure("cancelled", f"cancelled while {doing}"), earlier)
    return with_reason(Failure("budget", f"the budget of {budget.seconds:.3g} s ended while {doing}"), earlier)


def with_reason(late: Failure, earlier: Failure | None) -> Failure:
    """Return a failure; one for lack of time with the reason for which the search went on, and its witness."""
    if earlier is None or late.kind not in ("budget", "cancelled"):
        return late
    return Failure(late.kind, f"{late.detail}; before that: {earlier.detail}", {**earlier.witness, **late.witness})
