"""`circle`: the tool goes round and ends where it started; the goal is the start's own configuration or pose."""

from functools import partial
from typing import Literal

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.geometry.poses import pose_error
from optiplan.planners.cartesian.base import ToolMotion, ToolMotionOptions
from optiplan.planners.cartesian.tool_path import ToolPath, circle
from optiplan.planners.option_schema import OptionError, option, option_error
from optiplan.records import dataclass

_PLANES = {"xy": (0, 1), "yz": (1, 2), "xz": (0, 2)}
"""The two axes that span a plane; the second points to the circle's top."""
_OFF = 1e-3  # m: how far a centre may be from the plane through the start

_error = partial(option_error, "circle")


@dataclass(frozen=True)
class CircleOptions(ToolMotionOptions):
    """Also the circle: `centre` and `normal`, or `radius` and `plane`, with the start at its top."""

    centre: tuple[float, ...] | None = option(None, "(3,) m, in the world.", size=3)
    normal: tuple[float, ...] | None = option(
        None, "(3,) of any length; the circle turns about it, counterclockwise seen from its tip.", size=3
    )
    radius: float | None = option(None, "m.", above=0)
    plane: Literal["xy", "yz", "xz"] | None = option(
        None,
        "of the world's axes. The centre is `radius` from the start against the plane's second axis, the normal is "
        "the first axis x the second.",
    )
    turns: int = option(1, "whole ones; negative ones go the other way.")
    orientation: Literal["kept", "following"] = option("kept", "of the tool: `kept`, or `following` the turn.")

    def __post_init__(self) -> None:
        super().__post_init__()
        given = [part is not None for part in (self.centre, self.normal, self.radius, self.plane)]
        if given not in ([True, True, False, False], [False, False, True, True]):
            names = [name for name, there in zip(("centre", "normal", "radius", "plane"), given, strict=True) if there]
            found = " and ".join(names) or "nothing"
            raise OptionError("centre", found, "centre and normal, or radius and plane")
        if self.normal is not None and not np.any(self.normal):
            raise OptionError("normal", "[0, 0, 0]", "a direction")
        if self.turns == 0:
            raise OptionError("turns", "0", "a whole number other than 0")


class Circle(ToolMotion[CircleOptions]):
    """Planner of circles of the tool."""

    Options = CircleOptions

    def path(self, start: pin.SE3, goal: pin.SE3, tolerance: tuple[float, float]) -> ToolPath:
        """Round the axis, from the start's pose to itself.

        Raises:
            InputError: the goal is elsewhere, or the centre is not in the plane through the start.
        """
        distance, angle = pose_error(start, goal)
        if distance > tolerance[0] or angle > tolerance[1]:
            found = f"a pose {distance:.4g} m and {angle:.4g} rad from the start's"
            raise _error("goal", found, "the start's own configuration or pose: a circle ends where it begins")
        centre, normal = self._axis(start.translation)
        off = normal @ (start.translation - centre)
        if abs(off) > _OFF:
            fits = np.round(centre + off * normal, 6).tolist()
            raise _error("centre", f"{abs(off):.4g} m off the plane through the start", f"a point such as {fits}")
        rotation = 2.0 * np.pi * self.options.turns * normal
        return circle(start, centre, rotation, rotation if self.options.orientation == "following" else np.zeros(3))

    def _axis(self, start: Array) -> tuple[Array, Array]:
        """Centre and unit normal, (3,) each."""
        o = self.options
        if o.centre is not None and o.normal is not None:
            return np.array(o.centre), np.array(o.normal) / np.linalg.norm(o.normal)
        across, up = (np.eye(3)[i] for i in _PLANES[o.plane or "xy"])
        return start - (o.radius or 0.0) * up, np.cross(across, up)
