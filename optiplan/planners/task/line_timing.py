"""Time the path of a line, within the limits of joints and tool."""

import numpy as np

from optiplan.planners.base import Budget
from optiplan.planners.task.chains import PlannedStep
from optiplan.planners.task.stages import Stage
from optiplan.problem.constraints.motions import ToolSpeed
from optiplan.problem.task.steps import StraightLine
from optiplan.trajectory.timing.time_path import TimingOptions, ToolLimits, time_path
from optiplan.trajectory.trajectory import Trajectory


def line_limits(done: PlannedStep) -> ToolLimits | None:
    """Return what limits the tool along a line: its own speed, and constraints of speed of the same frame."""
    action = done.step.action
    assert isinstance(action, StraightLine)
    assert done.stage is not None
    linear, angular = action.speed, np.inf
    for one in done.stage.problem.path_constraints:
        if isinstance(one, ToolSpeed) and one.frame == action.frame:
            linear, angular = min(linear, one.linear), min(angular, one.angular)
    return ToolLimits(action.frame, linear, angular) if np.isfinite(min(linear, angular)) else None


def timed_line(stage: Stage, path: Trajectory, tool: ToolLimits | None, budget: Budget) -> Trajectory | None:
    """Run along a path from rest to rest; None where gravity takes more torque than allowed.

    Once the budget is over, the law is the best that there is by then.
    """
    options = TimingOptions(None, tool, stop=lambda: budget.over)
    return time_path(path, stage.problem.robot, stage.problem.limits, options)
