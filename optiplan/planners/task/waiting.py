"""Steps of a task among obstacles that move: each waits, or goes slower, until what moves has passed."""

from dataclasses import replace

from optiplan.collision.native_model import planning_model
from optiplan.geometry.scene import Scene
from optiplan.planners.base import Budget, Failure
from optiplan.planners.common.continuous_collision import first_contact
from optiplan.planners.common.dynamic_obstacles import delayed
from optiplan.planners.task.chains import of_step
from optiplan.planners.task.stretches import Stretch
from optiplan.problem.problem import Problem, derived
from optiplan.trajectory.joining import standstill
from optiplan.trajectory.trajectory import Trajectory


def waiting(problem: Problem, stretches: list[Stretch], budget: Budget) -> list[Stretch] | Failure:
    """Return the stretches, each delayed as far as what moves asks for, or the failure of the first that meets it.

    They are free of what stands. One after another: where a later one would need it, an earlier one does not hurry.
    """
    found: list[Stretch] = []
    begin = 0.0
    for stretch in stretches:
        timed = _passing(derived(problem, scene=problem.scene.later(begin)), stretch, budget)
        if isinstance(timed, Failure):
            first = stretch.done[0]
            return of_step(timed, first.step, first.before, problem.robot, first.stage)
        found.append(timed)
        begin += timed.ends[-1]
    return found


def _passing(problem: Problem, stretch: Stretch, budget: Budget) -> Stretch | Failure:
    """Return a stretch that begins now in the motion of the obstacles, delayed."""
    first, motion = stretch.done[0], stretch.motion
    moving = problem.scene.dynamic_obstacles
    if not moving or motion == 0.0:
        return stretch
    allowed = frozenset().union(*(done.step.allowed for done in stretch.done), problem.scene.allowed)
    scene = Scene(moving, first.before.scene.attached, allowed)
    if isinstance(motion, Trajectory):
        assert first.stage is not None
        own = derived(first.stage.problem, scene=scene, goal=())
        passing = delayed(own, [motion], planning_model(own.robot, scene), budget)
        if isinstance(passing, Failure):
            return passing
        slower = (passing.motion.duration - passing.wait) / motion.duration
        return replace(stretch, motion=passing.motion, ends=tuple(passing.wait + slower * end for end in stretch.ends))
    still = standstill(problem.robot.joint_names, first.before.q, motion)
    met = first_contact(planning_model(problem.robot, scene), still, lambda: budget.over)
    if met is None:
        return stretch
    pair = met.contact.pair
    return Failure("collision", f"'{pair.name_a}' meets '{pair.name_b}', which moves", met.witness(still))
