"""Steps of a task among dynamic obstacles: each waits, or goes slower, until the obstacles have passed."""

from collections.abc import Sequence
from dataclasses import replace

from optiplan.collision.native_model import planning_model
from optiplan.geometry.scene import Obstacle, Scene
from optiplan.planners.base import Budget, Failure
from optiplan.planners.common.continuous_collision import first_contact
from optiplan.planners.common.dynamic_obstacles import delayed
from optiplan.planners.common.failures import out_of_time
from optiplan.planners.task.chains import of_step
from optiplan.planners.task.planned_steps import PlannedMotion, Stretch, TaskPart
from optiplan.problem.problem import Problem, derived
from optiplan.trajectory.joining import standstill


def waiting(problem: Problem, parts: Sequence[TaskPart], budget: Budget) -> list[TaskPart] | Failure:
    """Return the parts, each delayed until dynamic obstacles have passed, or the failure of the first in contact.

    The parts are free of static obstacles. They are delayed one after another: no part hurries for a later one.
    """
    names = {body.name for body in problem.scene.dynamic_obstacles}
    found: list[TaskPart] = []
    begin = 0.0
    for part in parts:
        later = problem.scene.later(begin)
        around = tuple(body for body in later.obstacles if body.name in names)  # some may have stopped by then
        timed = _passing(problem, part, around, budget)
        if isinstance(timed, Failure):
            first = part.steps[0]
            stage = first.stage if isinstance(first, PlannedMotion) else None
            return of_step(timed, first.step, first.before, problem.robot, stage)
        found.append(timed)
        begin += timed.duration
    return found


def _passing(problem: Problem, part: TaskPart, around: tuple[Obstacle, ...], budget: Budget) -> TaskPart | Failure:
    """Return a part among obstacles as they are and move when it begins, delayed where some of them move."""
    first = part.steps[0]
    if not around or part.duration == 0.0:
        return part
    allowed = frozenset().union(*(planned.step.allowed for planned in part.steps), problem.scene.allowed)
    scene = Scene(around, first.before.scene.attached, allowed, first.before.scene.safety)
    if isinstance(part, Stretch):
        columns = part.steps[0].stage.columns
        ends = [state.q[columns] for planned in part.steps for state in (planned.before, planned.after)]
        own = derived(part.steps[0].stage.problem, scene=scene.ending_at(*ends), goal=(), path_constraints=())
        motion = part.motion
    else:
        own = derived(problem, scene=scene.ending_at(first.before.q))
        motion = standstill(problem.robot.joint_names, first.before.q, part.duration)
    model = planning_model(own.robot, own.scene, error=own.tracking_error)
    if isinstance(part, Stretch) and scene.dynamic_obstacles:
        passing = delayed(own, [motion], model, budget)
        if isinstance(passing, Failure):
            return passing
        slower = (passing.motion.duration - passing.wait) / motion.duration
        return replace(part, motion=passing.motion, ends=tuple(passing.wait + slower * end for end in part.ends))
    met = first_contact(model, motion, lambda: budget.over)
    if met is None:
        return part
    if budget.over:
        return out_of_time(budget, "checking a step among what moves")
    words = "which moves" if scene.dynamic_obstacles else "which has come to stand there"
    return Failure("collision", f"{met.words}, {words}", met.witness(motion))
