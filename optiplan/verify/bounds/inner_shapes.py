"""What surely lies inside bodies: rods in the robot's convex bodies, boxes in obstacles."""

from typing import NamedTuple

import coal
import numpy as np
from scipy.optimize import linprog
from scipy.spatial import ConvexHull

from optiplan.arrays import Array, Index
from optiplan.collision.model import CollisionModel
from optiplan.geometry.meshes.box_surfaces import box_corners
from optiplan.verify.bounds.mesh_rods import mesh_rods

RODS_PER_BODY, RODS_PER_JOINT = 9, 24
"""Most thin rods of a body, and most rods of all bodies that one joint carries last."""

SHARES = (0.9, 0.5, 0.1)
"""Radii of a body's rods as shares of that of the largest ball inside it: thick ones are short, thin ones are long."""

WITHIN = 1e-5
"""m, by which rods are thinner than computed: more than rounding, and than what bodies that touch may overlap."""


class InnerRods(NamedTuple):
    """M rods, each all points within `radius` of a segment, inside bodies of the robot.

    Attributes:
        joint: (M,) whose frame the ends are in.
        ends: (M, 2, 3), m.
        radius: (M,), m.
        body: (M,) index in the collision model.
    """

    joint: Index
    ends: Array
    radius: Array
    body: Index


class InnerBoxes(NamedTuple):
    """K boxes with all that is within `round` of them, inside obstacles that stand still.

    Attributes:
        rotation: (K, 3, 3), columns are the box's axes in the world.
        centre: (K, 3), m.
        half: (K, 3), m.
        round: (K,), m.
        body: (K,) index in the collision model.
    """

    rotation: Array
    centre: Array
    half: Array
    round: Array
    body: Index


def rods_inside(model: CollisionModel) -> InnerRods:
    """Return rods inside the bodies that joints carry: hulls, meshes, boxes, balls, capsules and cylinders.

    A motion that begins outside of a mesh cannot get an obstacle to a place inside without contact.
    """
    found: list[tuple[int, Array, float, int]] = []
    for body, geometry in enumerate(model.geometry.geometryObjects):
        joint = int(geometry.parentJoint)
        if joint == 0 or joint > len(model.robot.kinematics.revolute):
            continue
        for ends, radius in _rods_of(geometry.geometry):
            if radius <= WITHIN:
                continue
            placed = ends @ geometry.placement.rotation.T + geometry.placement.translation
            found.append((joint, placed, radius - WITHIN, body))
    kept = _farthest(found)
    return InnerRods(
        np.array([rod[0] for rod in kept], dtype=np.intp),
        np.array([rod[1] for rod in kept]).reshape(-1, 2, 3),
        np.array([rod[2] for rod in kept]),
        np.array([rod[3] for rod in kept], dtype=np.intp),
    )


def _farthest(rods: list[tuple[int, Array, float, int]]) -> list[tuple[int, Array, float, int]]:
    """Keep some of each joint: the longest, then again and again the one whose ends are farthest from all kept ones."""
    kept = []
    for joint in sorted({rod[0] for rod in rods}):
        own = [rod for rod in rods if rod[0] == joint]
        if len(own) <= RODS_PER_JOINT:
            kept += own
            continue
        ends = np.array([rod[1] for rod in own])
        size = np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1) + 2.0 * np.array([rod[2] for rod in own])
        chosen = [int(size.argmax())]
        far = np.full(len(own), np.inf)
        while len(chosen) < RODS_PER_JOINT:
            last = ends[chosen[-1]]
            away = np.linalg.norm(ends[:, :, None] - last[None, None], axis=3).min(axis=2).max(axis=1)
            far = np.minimum(far, away)
            chosen.append(int((far + size).argmax()))
            far[chosen] = -np.inf
        kept += [own[k] for k in dict.fromkeys(chosen)]
    return kept


def _rods_of(shape: coal.CollisionGeometry) -> list[tuple[Array, float]]:
    """Rods in the body's own frame: ends (2, 3) and radius, m."""
    if isinstance(shape, coal.Sphere):
        return [(np.zeros((2, 3)), float(shape.radius))]
    if isinstance(shape, coal.Capsule):
        tip = np.array([0.0, 0.0, float(shape.halfLength)])
        return [(np.array([-tip, tip]), float(shape.radius))]
    if isinstance(shape, coal.Cylinder):
        radius, half = float(shape.radius), float(shape.halfLength)
        found = []
        for share in SHARES:
            thick = share * min(radius, half)
            tip = np.array([0.0, 0.0, half - thick])
            found.append((np.array([-tip, tip]), thick))
        return found
    if isinstance(shape, coal.BVHModelBase):
        return mesh_rods(shape)
    if (faces := _faces(shape)) is None:
        return []
    corners = np.array(shape.points()) if isinstance(shape, coal.ConvexBase) else box_corners(faces[1][:3])
    return _rods_between(*faces) + _rods_across(np.asarray(corners, dtype=np.float64), *faces)


def _faces(shape: coal.CollisionGeometry) -> tuple[Array, Array] | None:
    """Normals (F, 3) and offsets (F,), n x <= d, of a box or a hull; None of any other shape, or of a flat hull."""
    if isinstance(shape, coal.Box):
        half = np.array(shape.halfSide, dtype=np.float64).ravel()
        return np.vstack([np.eye(3), -np.eye(3)]), np.concatenate([half, half])
    if isinstance(shape, coal.ConvexBase):
        points = np.array(shape.points(), dtype=np.float64)
        if np.ptp(points, axis=0).min() < 1e-4:
            return None
        equations = ConvexHull(points).equations
        return equations[:, :3], -equations[:, 3]
    return None


def _rods_between(normals: Array, offsets: Array) -> list[tuple[Array, float]]:
    """Rods through the middle of the largest ball inside n x <= d: the longest for each of `SHARES` of its radius.

    From c along u the body ends, less a radius r, where n (c + s u) = d - r.
    """
    whole = np.column_stack([normals, np.ones(len(normals))])
    ball = linprog([0.0, 0.0, 0.0, -1.0], A_ub=whole, b_ub=offsets, bounds=[(None, None)] * 3 + [(0.0, None)])
    if not ball.success or ball.x[3] < 1e-3:
        return []
    centre, found = ball.x[:3], []
    rates = DIRECTIONS @ normals.T  # (D, F)
    for share in SHARES:
        room = np.maximum(offsets - share * float(ball.x[3]) - normals @ centre, 0.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            ahead = np.where(rates > 1e-9, room / rates, np.inf).min(axis=1)
            behind = np.where(rates < -1e-9, room / rates, -np.inf).max(axis=1)
        best = int((ahead - behind).argmax())
        ends = centre + np.array([[behind[best]], [ahead[best]]]) * DIRECTIONS[best]
        found.append((ends, float((offsets[:, None] - normals @ ends.T).min())))
    return found


def _rods_across(corners: Array, normals: Array, offsets: Array) -> list[tuple[Array, float]]:
    """Thin rods between far corners (V, 3) of n x <= d, the longest first, each away from those before.

    What is the share s of the way from a corner to the middle is s times as deep below each face, at least.
    """
    middle = corners.mean(axis=0)
    depth = float((offsets - normals @ middle).min())
    if depth < 4.0 * WITHIN:
        return []
    extreme = corners[np.unique((OUTWARD @ corners.T).argmax(axis=1))]
    extreme = extreme + (middle - extreme) * (2.5 * WITHIN / depth)
    first, second = np.triu_indices(len(extreme), 1)
    ends = np.stack([extreme[first], extreme[second]], axis=1)
    length = np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1)
    found: list[tuple[Array, float]] = []
    apart = np.full(len(ends), np.inf)
    while len(found) < RODS_PER_BODY and len(ends):
        best = int((np.minimum(apart, 1.0) * np.sqrt(length)).argmax())
        if apart[best] < 0.01 or length[best] < 0.01:
            break
        found.append((ends[best], 2.0 * WITHIN))
        same = np.linalg.norm(ends - ends[best], axis=2).max(axis=1)
        turned = np.linalg.norm(ends - ends[best][::-1], axis=2).max(axis=1)
        apart = np.minimum(apart, np.minimum(same, turned))
    return found


def _directions() -> Array:
    """A hundred unit vectors spread over half a sphere, and the three axes: (103, 3)."""
    k = np.arange(100) + 0.5
    height, turn = k / 100, np.pi * (1.0 + np.sqrt(5.0)) * k
    across = np.sqrt(1.0 - height**2)
    return np.vstack([np.eye(3), np.column_stack([across * np.cos(turn), across * np.sin(turn), height])])


DIRECTIONS = _directions()
OUTWARD = np.vstack([DIRECTIONS[:30], -DIRECTIONS[:30]])


def boxes_inside(model: CollisionModel) -> InnerBoxes:
    """Return boxes inside boxes, cylinders, balls and capsules that stand still; other obstacles have none."""
    rotation, centre, half, around, index = [], [], [], [], []
    for body, geometry in enumerate(model.geometry.geometryObjects):
        if int(geometry.parentJoint) != 0:
            continue
        for turned, size, outside in _boxes_of(geometry.geometry):
            rotation.append(np.array(geometry.placement.rotation) @ turned)
            centre.append(np.array(geometry.placement.translation))
            half.append(size)
            around.append(max(outside - WITHIN, 0.0))
            index.append(body)
    return InnerBoxes(
        np.array(rotation).reshape(-1, 3, 3),
        np.array(centre).reshape(-1, 3),
        np.array(half).reshape(-1, 3),
        np.array(around),
        np.array(index, dtype=np.intp),
    )


def _boxes_of(shape: coal.CollisionGeometry) -> list[tuple[Array, Array, float]]:
    """Rotation (3, 3), half edges (3,) and what is around them, m, of boxes inside a shape, about its origin."""
    if isinstance(shape, coal.Box):
        return [(np.eye(3), np.array(shape.halfSide, dtype=np.float64).ravel(), 0.0)]
    if isinstance(shape, coal.Sphere):
        return [(np.eye(3), np.zeros(3), float(shape.radius))]
    if isinstance(shape, coal.Capsule):
        return [(np.eye(3), np.array([0.0, 0.0, float(shape.halfLength)]), float(shape.radius))]
    if isinstance(shape, coal.Cylinder):
        side = float(shape.radius) / np.sqrt(2.0)
        return [(about_z(angle), np.array([side, side, float(shape.halfLength)]), 0.0) for angle in TURNS]
    return []


TURNS = np.pi / 8.0 * np.arange(4)
"""rad, of square prisms inside a cylinder."""


def about_z(angle: float) -> Array:
    """Return the rotation (3, 3) about z by an angle, rad."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
