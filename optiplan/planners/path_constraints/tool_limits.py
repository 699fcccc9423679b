"""Limits of the tool along a path that is given: what a planner asks for, and what the problem does."""

import numpy as np

from optiplan.problem.constraints.base import WHOLE
from optiplan.problem.constraints.motions import ToolSpeed
from optiplan.problem.problem import Problem
from optiplan.trajectory.timing.path_constraints import ToolLimits


def tool_limits(
    problem: Problem,
    frame: str,
    linear: float = np.inf,
    angular: float = np.inf,
    linear_acceleration: float = np.inf,
    *,
    parts: bool = True,
) -> ToolLimits | None:
    """Return these limits of a frame, m/s, rad/s and m/s², within constraints of speed on it; None without any.

    With `parts`, a constraint of a part of the motion counts for the whole: when this part begins is not known before
    it is timed.
    """
    for one in problem.path_constraints:
        if isinstance(one, ToolSpeed) and one.frame == frame and (parts or one.during == WHOLE):
            linear, angular = min(linear, one.linear), min(angular, one.angular)
    limited = np.isfinite(min(linear, angular, linear_acceleration))
    return ToolLimits(frame, linear, angular, linear_acceleration) if limited else None


def all_tool_limits(problem: Problem, frame: str, linear: float) -> tuple[ToolLimits, ...]:
    """Return the limits of all frames whose speed is limited: of this one, m/s, and where constraints say so."""
    others = [one.frame for one in problem.path_constraints if isinstance(one, ToolSpeed) and one.frame != frame]
    found = [tool_limits(problem, frame, linear), *(tool_limits(problem, other) for other in dict.fromkeys(others))]
    return tuple(one for one in found if one is not None)
