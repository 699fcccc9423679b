"""Stick figure of a robot without geometry: a rod to each joint and to the tool, and their axes."""

from collections.abc import Iterator
from typing import NamedTuple

import coal
import numpy as np
import pinocchio as pin

from optiplan.robot.robot import Robot
from optiplan.viewer.surfaces import Colour

_ROD: Colour = (0.55, 0.60, 0.64, 1.0)
_AXES: tuple[Colour, ...] = ((0.82, 0.15, 0.12, 1.0), (0.18, 0.60, 0.28, 1.0), (0.14, 0.40, 0.80, 1.0))  # x, y, z
_AXIS, _THICK = 0.07, 0.006  # length of an axis and radius of a rod, shares of the robot's length
_LEAST = 1e-6  # m: shorter than that is no rod


class Piece(NamedTuple):
    """A cylinder along z at pose X_BP in body B: 0 is the world, j the robot's joint j."""

    name: str
    body: int
    X_BP: pin.SE3
    cylinder: coal.Cylinder
    colour: Colour


def skeleton(robot: Robot) -> Iterator[Piece]:
    """Return rods from the origin of each body to its children and to the tool, and the three axes at each end."""
    model = robot.model
    tool = model.frames[model.getFrameId(robot.tool_frame)]
    joints = range(1, model.njoints)
    ends: list[tuple[str, int, pin.SE3, int | None]] = [
        *((model.names[j], model.parents[j], model.jointPlacements[j], j) for j in joints),
        (tool.name, tool.parentJoint, tool.placement, None),
    ]
    size = sum(float(np.linalg.norm(X.translation)) for _, _, X, _ in ends) or 1.0
    for name, parent, X_BE, body in ends:
        if np.linalg.norm(X_BE.translation) > _LEAST:
            yield Piece(name, parent, *_along(pin.SE3.Identity(), X_BE.translation, _THICK * size), _ROD)
        held, X = (parent, X_BE) if body is None else (body, pin.SE3.Identity())  # a joint's axes turn with it
        for axis, colour in zip(np.eye(3), _AXES, strict=True):
            yield Piece(name, held, *_along(X, _AXIS * size * axis, 0.5 * _THICK * size), colour)


def _along(X_BF: pin.SE3, way: np.ndarray, radius: float) -> tuple[pin.SE3, coal.Cylinder]:
    """The cylinder from the origin of frame F to the point `way` (3,) in it, m, and its pose in B."""
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), way)
    return X_BF * pin.SE3(turn.matrix(), 0.5 * way), coal.Cylinder(radius, float(np.linalg.norm(way)))
