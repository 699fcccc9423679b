"""Path constraints on the origin of a frame."""

import math
from typing import Annotated, Any, ClassVar, TypeAlias

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.config.document import Strict
from optiplan.config.values import Coordinate, Size, Vector
from optiplan.geometry.pose import PoseSpec, pose_of
from optiplan.geometry.poses import pose_to_data
from optiplan.problem.constraints.base import WHOLE, Distance, During, Frame, Key, Point, Statement, UnitVector, array
from optiplan.records import dataclass

From: TypeAlias = Annotated[Array, Key(Vector, array, name="from")]
To: TypeAlias = Annotated[Array, Key(Vector, array, name="to")]


class BoxSpec(Strict):
    """A box of edge lengths `size`, m, at `pose` in the world."""

    size: Size
    pose: PoseSpec = PoseSpec.model_construct()


@dataclass(frozen=True, eq=False)
class PositionBox(Statement):
    """The origin of a frame stays in a box.

    Attributes:
        frame: a link or fixed frame of the robot.
        size: (3,) edge lengths, m.
        X_WC: pose of the box in the world.
        during: part of the motion.
    """

    KEY: ClassVar[str] = "position"

    frame: Frame
    size: Annotated[Array, Key(BoxSpec, np.array, lambda size: np.asarray(size).tolist(), name="box", part="size")]
    X_WC: Annotated[pin.SE3, Key(BoxSpec, pose_of, pose_to_data, name="box", part="pose")]
    during: During = WHOLE


@dataclass(frozen=True, eq=False)
class OnPlane(Statement):
    """The origin p of a frame stays near a plane: |normal · p - offset| <= within.

    Attributes:
        frame: a link or fixed frame of the robot.
        normal: (3,) unit vector in the world.
        offset: m.
        within: m.
        during: part of the motion.
    """

    KEY: ClassVar[str] = "plane"

    frame: Frame
    normal: UnitVector
    offset: Annotated[float, Key(Coordinate)]
    within: Distance
    during: During = WHOLE


@dataclass(frozen=True, eq=False)
class OnLine(Statement):
    """The origin of a frame stays near the segment between two points.

    Attributes:
        frame: a link or fixed frame of the robot.
        start, end: (3,) in the world, m; `from` and `to` in a file.
        within: m.
        during: part of the motion.
    """

    KEY: ClassVar[str] = "line"

    frame: Frame
    start: From
    end: To
    within: Distance
    during: During = WHOLE


@dataclass(frozen=True, eq=False)
class OnCircle(Statement):
    """The origin of a frame stays near a circle.

    Attributes:
        frame: a link or fixed frame of the robot.
        centre: (3,) m.
        normal: (3,) unit vector along its axis.
        radius: m.
        within: m.
        during: part of the motion.
    """

    KEY: ClassVar[str] = "circle"

    frame: Frame
    centre: Point
    normal: UnitVector
    radius: Distance
    within: Distance
    during: During = WHOLE


@dataclass(frozen=True, eq=False)
class OnArc(Statement):
    """The origin of a frame stays near the circular arc between two points, through a third.

    Attributes:
        frame: a link or fixed frame of the robot.
        start, through, end: (3,) in the world, m; not in line; `from`, `through` and `to` in a file.
        within: m.
        during: part of the motion.
    """

    KEY: ClassVar[str] = "arc"

    frame: Frame
    start: From
    through: Point
    end: To
    within: Distance
    during: During = WHOLE

    @classmethod
    def consistent(cls, stated: Any) -> Any:
        """Return what stands in a file, if its points are not in line."""
        a, b, c = (getattr(stated, key) for key in ("from", "through", "to"))
        u, v = ([y - x for x, y in zip(a, end, strict=True)] for end in (b, c))
        cross = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
        if math.hypot(*cross) <= 1e-6 * math.hypot(*u) * math.hypot(*v) or math.hypot(*u) * math.hypot(*v) == 0.0:
            raise ValueError("found three points in line; expected points of an arc")
        return stated
