"""Reasons that several planners give in the same words."""

from typing import Any

from optiplan.arrays import Array
from optiplan.model.collision import CollisionModel, Contact
from optiplan.planners.base import Budget, Failure


def contact_witness(q: Array, contact: Contact) -> dict[str, Any]:
    """JSON-ready place of a contact: configuration, bodies, nearest points (world, m) and distance (m)."""
    return {
        "q": q.tolist(),
        "pair": [contact.pair.name_a, contact.pair.name_b],
        "points": [contact.point_a.tolist(), contact.point_b.tolist()],
        "distance": contact.distance,
    }


def end_collides(model: CollisionModel, q: Array, end: str) -> Failure:
    """The `start` or the `goal` configuration q (n,), known to collide, as a failure that names the bodies."""
    contact = model.clearance(q)
    if contact is None:
        raise ValueError("a model without pairs does not collide")
    pair, depth = contact.pair, max(0.0, -contact.distance)
    detail = f"{end} configuration: '{pair.name_a}' and '{pair.name_b}' overlap by {depth * 1e3:.3g} mm"
    return Failure(f"{end}-in-collision", detail, contact_witness(q, contact))


def too_heavy() -> Failure:
    """The path is free, but holding the arm on it takes more torque than the limits allow."""
    return Failure("unsupported", "a free path was found, but gravity alone exceeds the torque limits on it")


def out_of_time(budget: Budget, doing: str) -> Failure:
    """The budget ended, or somebody cancelled, while `doing` something."""
    if budget.cancelled:
        return Failure("cancelled", f"cancelled while {doing}")
    return Failure("budget", f"the budget of {budget.seconds:.3g} s ended while {doing}")
