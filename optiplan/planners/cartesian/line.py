"""`line` (moveL): the tool moves straight from the start's pose to the goal's and turns evenly about one axis."""

import pinocchio as pin

from optiplan.planners.cartesian.path import ToolPath, line
from optiplan.planners.cartesian.tool_motion import ToolMotion, ToolMotionOptions


class Line(ToolMotion[ToolMotionOptions]):
    """See the module."""

    def path(self, start: pin.SE3, goal: pin.SE3, tolerance: tuple[float, float]) -> ToolPath:
        """Straight from one pose to the other."""
        return line(start, goal)
