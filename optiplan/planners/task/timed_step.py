"""Time a planned step from rest to rest."""

from optiplan.planners.base import Budget, Failure
from optiplan.planners.common.failures import path_too_heavy
from optiplan.planners.task.chains import of_step
from optiplan.planners.task.planned_steps import Pause, PlannedMotion, PlannedStep, Stretch, TaskPart
from optiplan.problem.task.steps import Dwell
from optiplan.trajectory.timing.time_path import TimingOptions, time_path


def timed_step(planned: PlannedStep, budget: Budget) -> TaskPart | Failure:
    """Return a step from rest to rest; a line is timed within the limits of joints and tool."""
    if not isinstance(planned, PlannedMotion):
        action = planned.step.action
        return Pause(planned, action.seconds if isinstance(action, Dwell) else 0.0)
    if not planned.is_line:
        return Stretch.of(planned, planned.curve)
    problem, path = planned.stage.problem, planned.curve
    options = TimingOptions(None, planned.tool_limits, stop=lambda: budget.over)
    motion = time_path(path, problem.robot, problem.limits, options)
    if motion is None:
        heavy = path_too_heavy(problem.robot, problem.limits, path)
        return of_step(heavy, planned.step, planned.before, problem.robot, planned.stage)
    return Stretch.of(planned, motion)
