"""`line` (moveL): the tool moves straight from the start's pose to the goal's and turns evenly about one axis."""

import pinocchio as pin

from optiplan.planners.cartesian.base import ToolMotion, ToolMotionOptions
from optiplan.planners.cartesian.tool_path import ToolPath, line


class Line(ToolMotion[ToolMotionOptions]):
    """Planner of a straight line of the tool."""

    Options = ToolMotionOptions

    def path(self, start: pin.SE3, goal: pin.SE3, tolerance: tuple[float, float]) -> ToolPath:
        """Straight from one pose to the other."""
        return line(start, goal)
