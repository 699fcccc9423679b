"""`screw`: the tool turns about one axis and slides along it, both evenly: X(s) = X(0) exp(s log(X(0)^-1 X(1)))."""

import numpy as np
import pinocchio as pin

from optiplan.geometry.poses import pose_error, pose_to_data
from optiplan.planners.cartesian.base import ToolMotion, ToolMotionOptions
from optiplan.planners.cartesian.tool_path import ToolPath, screw, screw_about
from optiplan.planners.option_schema import OptionError, option, option_error
from optiplan.records import dataclass


@dataclass(frozen=True)
class ScrewOptions(ToolMotionOptions):
    """Also another screw than the one that leads to the goal by half a turn at most."""

    turns: int = option(0, "whole turns about the axis of that screw on top.")
    axis: tuple[float, ...] | None = option(
        None, "(3,) of any length, with `point` and `angle`: this screw, which must end at the goal.", size=3
    )
    point: tuple[float, ...] | None = option(None, "(3,) m, on the axis.", size=3)
    angle: float | None = option(None, "rad.")
    pitch: float | None = option(None, "m of sliding for every rad.")

    def __post_init__(self) -> None:
        super().__post_init__()
        given = [name for name in ("axis", "point", "angle") if vars(self)[name] is not None]
        if given and len(given) < 3:
            raise OptionError(given[0], f"{' and '.join(given)} alone", "axis, point and angle together")
        if given and self.turns:
            raise OptionError("turns", f"{self.turns} with axis, point and angle", "an angle with all turns in it")
        if self.pitch is not None and not given:
            raise OptionError("pitch", "given alone", "axis, point and angle as well")
        if self.axis is not None and not np.any(self.axis):
            raise OptionError("axis", "[0, 0, 0]", "a direction")


class Screw(ToolMotion[ScrewOptions]):
    """Planner of one screw motion of the tool."""

    Options = ScrewOptions

    def path(self, start: pin.SE3, goal: pin.SE3, tolerance: tuple[float, float]) -> ToolPath:
        """The screw given, or the one from pose to pose.

        Raises:
            InputError: the screw given does not end at the goal.
        """
        o = self.options
        if o.axis is None or o.point is None or o.angle is None:
            return screw(start, goal, o.turns)
        axis = np.array(o.axis) / np.linalg.norm(o.axis)
        path = screw_about(start, axis, np.array(o.point), o.angle, (o.pitch or 0.0) * o.angle)
        distance, angle = pose_error(path.end, goal)
        if distance > tolerance[0] or angle > tolerance[1]:
            end = {key: np.round(value, 6).tolist() for key, value in pose_to_data(path.end).items()}
            found = f"a pose {distance:.4g} m and {angle:.4g} rad from where the screw ends"
            raise option_error("screw", "goal", found, f"pose {end}")
        return path
