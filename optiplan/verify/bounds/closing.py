"""Boxes of configurations that no motion shorter than T passes, by the native core."""

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from optiplan._core import core
from optiplan.arrays import Array
from optiplan.collision.model import CollisionModel
from optiplan.records import dataclass
from optiplan.robot.native_tree import native_tree
from optiplan.verify.bounds.inner_shapes import InnerBoxes, InnerRods, boxes_inside, rods_inside
from optiplan.verify.bounds.times import Corridor, Passage

if TYPE_CHECKING:
    from optiplan._core._core_base import BoxClosing

States = npt.NDArray[np.uint8]

UNKNOWN, CLOSED, PASSABLE = 0, 1, 2
"""What is known of a box: nothing; no motion shorter than T passes it; one of its configurations cannot be closed."""

AT_ONCE = 100_000
"""Parts of boxes that are examined between two looks at the clock."""


@dataclass(frozen=True)
class Closing:
    """Closes boxes for the ways of a `passage` through a scene.

    `sway` (n,) is how far a joint moves the rods for each rad or m, in the mean, m.

    A box is closed if halving it gives parts that are outside the corridor of all motions shorter than T in every step
    of their time, or in collision throughout: a rod inside a body of the robot meets a box inside an obstacle in every
    configuration. For that the ends of the rods are enclosed: p(q) = p(Q) + sum_j J_j d_j + r with |r| <= 1/2 sum_jk
    w_max(j, k) D_j D_k. |d| <= D, and w_k is the greatest distance of the point from axis k. Two reasons count.

    - A point of the rod is nearer to the box than the rod's radius.
    - The ends are on both sides of a plane across the box, and between them the rod crosses it within the box.
    """

    passage: Passage
    native: "BoxClosing"
    sway: Array

    @classmethod
    def of(cls, model: CollisionModel, passage: Passage) -> "Closing | None":
        """Return what closes boxes; None without the core, or where no body of the robot can meet a box."""
        rods, boxes = rods_inside(model), boxes_inside(model)
        known = {(pair.a, pair.b) for pair in model.pairs}
        bodies, body = np.unique(rods.body, return_inverse=True)
        pairs = [
            (k, b)
            for k, one in enumerate(bodies.tolist())
            for b, other in enumerate(boxes.body.tolist())
            if {(one, other), (other, one)} & known
        ]
        if core is None or not pairs:
            return None
        turns, turn_of = np.unique(boxes.rotation.reshape(-1, 9), axis=0, return_inverse=True)
        limits = passage.limits
        arms = _arms(model, rods, limits.lower, limits.upper)
        native = core.BoxClosing(
            native_tree(model.robot.model),
            np.ascontiguousarray(rods.ends.reshape(-1, 3)),
            rods.radius,
            rods.joint.astype(np.int64),
            body.astype(np.int64),
            np.array(pairs, dtype=np.int64),
            np.ascontiguousarray(turns.reshape(-1, 3, 3).transpose(0, 2, 1)),
            _along_own_axes(boxes),
            turn_of.ravel().astype(np.int64),
            arms,
        )
        return cls(passage, native, model.robot.kinematics.planned_bound(arms.mean(axis=0)))

    def close(self, corridor: Corridor, low: Array, high: Array, parts: int) -> States:
        """Return what is known of boxes [low, high] (N, n), each halved into at most `parts` parts: (N,).

        Motions within `corridor` are meant.
        """
        low, high = np.ascontiguousarray(low), np.ascontiguousarray(high)
        return np.asarray(self.native.close(corridor.low, corridor.high, low, high, parts))


def _along_own_axes(boxes: InnerBoxes) -> Array:
    """Centres along each box's own axes, half edges, and what is around the box: (K, 7), m."""
    centre = np.einsum("kia,ki->ka", boxes.rotation, boxes.centre)
    return np.ascontiguousarray(np.hstack([centre, boxes.half, boxes.round[:, None]]))


def _arms(model: CollisionModel, rods: InnerRods, lower: Array, upper: Array) -> Array:
    """Greatest distances (2 M, J), m, of the ends of rods from the axes of the joints that carry them; 0 of others."""
    kinematics = model.robot.kinematics
    stroke = np.maximum(np.abs(lower), np.abs(upper))
    stroke = np.where(np.isfinite(stroke), stroke, 0.0)  # a joint without end turns: its stroke does not matter
    joint, ends = np.repeat(rods.joint, 2), rods.ends.reshape(-1, 3)
    arms = np.zeros((len(joint), len(kinematics.revolute)))
    for j in np.unique(joint).tolist():
        own = joint == j
        arms[own] = kinematics.moment_arms(int(j), ends[own][:, None], stroke)
    return arms * (1.0 + 1e-9)
