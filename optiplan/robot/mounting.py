"""Mounting of a robot: pose of its base, gravity, payload, and frames of what it carries, in pinocchio's model."""

from collections.abc import Callable
from dataclasses import field
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.geometry.poses import ReadOnlyPoses
from optiplan.records import dataclass

GRAVITY = (0.0, 0.0, -9.81)
"""m/s², of a robot whose base stands upright on Earth."""


class FixedFrame(NamedTuple):
    """A frame that a link carries at X_LF: the TCP of a tool, or what is `held` and may be let go."""

    name: str
    link: str
    X_LF: pin.SE3
    held: bool = False


@dataclass(frozen=True, eq=False)
class Mounting(ReadOnlyPoses):
    """Pose of the base, gravity, payload and frames.

    Attributes:
        X_WB: pose of the robot's root in the world.
        gravity: (3,) acceleration of free fall in the world, m/s².
        payload: links and the spatial inertia that each carries, in the frame of the link (kg, m, kg m²).
        frames: of tools and of what is held; they are frames of the model like those of the robot's own description.
    """

    X_WB: pin.SE3 = field(default_factory=pin.SE3.Identity)
    gravity: Array = field(default_factory=lambda: np.array(GRAVITY))
    payload: tuple[tuple[str, pin.Inertia], ...] = ()
    frames: tuple[FixedFrame, ...] = ()

    @property
    def usual(self) -> bool:
        """Whether the robot stands at the origin of the world, upright on Earth, without payload and frames."""
        upright = bool((self.X_WB.homogeneous == np.eye(4)).all()) and tuple(self.gravity) == GRAVITY
        return upright and not self.payload and not self.frames

    @property
    def key(self) -> str:
        """The key of the mounting, equal for equal mountings."""
        loads = [(link, inertia.toDynamicParameters().tolist()) for link, inertia in self.payload]
        frames = [(one.name, one.link, one.X_LF.homogeneous.tolist(), one.held) for one in self.frames]
        return repr((self.X_WB.homogeneous.tolist(), np.asarray(self.gravity, dtype=float).tolist(), loads, frames))

    @property
    def mass(self) -> float:
        """Mass of the payload, kg."""
        return float(sum(inertia.mass for _, inertia in self.payload))

    def model(self, model: pin.Model) -> pin.Model:
        """Return the kinematic and dynamic model of a robot with this mounting."""
        mounted = model.copy()
        for joint in range(1, mounted.njoints):
            if mounted.parents[joint] == 0:
                mounted.jointPlacements[joint] = self.X_WB * mounted.jointPlacements[joint]
        for index in range(1, mounted.nframes):  # the first is the world itself
            frame = mounted.frames[index]
            if frame.parentJoint == 0:
                frame.placement = self.X_WB * frame.placement
        mounted.inertias[0] = self.X_WB.act(mounted.inertias[0])  # what no joint moves: the base
        mounted.gravity.linear = np.array(self.gravity)
        for link, inertia in self.payload:
            frame = mounted.frames[mounted.getFrameId(link, pin.FrameType.BODY)]
            mounted.appendBodyToJoint(frame.parentJoint, inertia, frame.placement)
        for one in self.frames:
            index = mounted.getFrameId(one.link, pin.FrameType.BODY)
            link = mounted.frames[index]
            X_JF, kind = link.placement * one.X_LF, pin.FrameType.OP_FRAME
            mounted.addFrame(pin.Frame(one.name, link.parentJoint, index, X_JF, kind))
        return mounted

    def geometry(self, geometry: pin.GeometryModel) -> pin.GeometryModel:
        """Return the bodies, with the links that no joint moves at the new base."""
        mounted = geometry.copy()
        for body in mounted.geometryObjects:
            if body.parentJoint == 0:
                body.placement = self.X_WB * body.placement
        return mounted

    def visual(self, build: Callable[[], pin.GeometryModel]) -> Callable[[], pin.GeometryModel]:
        """Return `geometry` for bodies that are built later."""
        return lambda: self.geometry(build())
