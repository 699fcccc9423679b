"""Default bodies of the links of a Denavit–Hartenberg table, and the inertia of links."""

import math
from collections.abc import Callable

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.robot.dh.spec import BodySpec, DhPoseSpec, DhRoundSpec, DhSpec, LinkSpec
from optiplan.robot.dh.table import DhTable


def body_pose(body: DhPoseSpec, spec: DhSpec) -> pin.SE3:
    """Pose X_LB of a body in its link."""
    return pin.SE3(pin.rpy.rpyToMatrix(*spec.rotation(body)), np.array(body.position))


def default_bodies(spec: DhSpec) -> list[list[BodySpec]]:
    """Capsules of the radius of the table along the offsets that each link spans; none without a radius.

    In the frame of the row. Standard: the row's a lies before its frame, from (-a, 0, 0) to 0, and its d before that,
    against the z axis of the frame before: (0, sin alpha, cos alpha). Modified: the row's d lies before its frame,
    along z, and the a of the *next* row after it, along x. A prismatic joint's d is left out where the row's link does
    not carry it.
    """
    if spec.radius is None:
        return [[] for _ in spec.rows]
    turn = math.degrees if spec.unit == "deg" else float
    return [[_capsule(a, b, spec.radius, turn) for a, b in found] for found in _segments(spec.table())]


def _segments(table: DhTable) -> list[list[tuple[Array, Array]]]:
    origin, result = np.zeros(3), []
    for i, row in enumerate(table.rows):
        if table.convention == "standard":
            corner = np.array([-row.a, 0.0, 0.0])
            found = [(corner, origin)]
            back = row.d * np.array([0.0, math.sin(row.alpha), math.cos(row.alpha)])
            if row.joint != "prismatic":
                found.append((corner - back, corner))
        else:
            after = table.rows[i + 1].a if i + 1 < len(table.rows) else 0.0
            found = [(np.array([0.0, 0.0, -row.d]), origin), (origin, np.array([after, 0.0, 0.0]))]
        result.append([(a, b) for a, b in found if not np.array_equal(a, b)])
    return result


def _capsule(start: Array, end: Array, radius: float, turn: Callable[[float], float]) -> BodySpec:
    """The capsule between two points; `turn` makes the unit of the table from rad."""
    length = float(np.linalg.norm(end - start))
    x, y, z = (end - start) / length
    rpy = [0.0, math.acos(max(-1.0, min(1.0, z))), math.atan2(y, x)]  # Rz(yaw) Ry(pitch) takes z to the direction
    position = [float(value) for value in (start + end) / 2]
    capsule = DhRoundSpec(radius=radius, length=length)
    return BodySpec(capsule=capsule, position=position, rpy=[turn(angle) for angle in rpy])


def inertia_of(link: LinkSpec, spec: DhSpec) -> pin.Inertia:
    """Spatial inertia of a link in its frame: as stated, else its bodies filled evenly.

    I = Σ_b (m V_b / Σ V) Î_b with Î_b the inertia of body b for 1 kg; bodies that overlap count twice there.
    A link of mass 0 without bodies has none.
    """
    mass = link.mass or 0.0
    if link.centre is not None and link.inertia is not None:
        return pin.Inertia(mass, np.array(link.centre), np.diag(link.inertia))
    total = pin.Inertia.Zero()
    volumes = [_volume(body) for body in link.geometry or ()]
    for body, volume in zip(link.geometry or (), volumes, strict=True):
        total = total + body_pose(body, spec).act(_unit_inertia(body, mass * volume / sum(volumes)))
    return total


def _volume(body: BodySpec) -> float:
    if body.box is not None:
        return math.prod(body.box)
    if body.sphere is not None:
        return 4.0 / 3.0 * math.pi * body.sphere**3
    if body.cylinder is not None:
        return math.pi * body.cylinder.radius**2 * body.cylinder.length
    assert body.capsule is not None  # the schema holds exactly one shape
    return math.pi * body.capsule.radius**2 * (body.capsule.length + 4.0 / 3.0 * body.capsule.radius)


def _unit_inertia(body: BodySpec, mass: float) -> pin.Inertia:
    """Inertia of one body of `mass` in its own frame."""
    if body.box is not None:
        return pin.Inertia.FromBox(mass, *body.box)
    if body.sphere is not None:
        return pin.Inertia.FromSphere(mass, body.sphere)
    if body.cylinder is not None:
        return pin.Inertia.FromCylinder(mass, body.cylinder.radius, body.cylinder.length)
    assert body.capsule is not None  # the schema holds exactly one shape
    return pin.Inertia.FromCapsule(mass, body.capsule.radius, body.capsule.length)
