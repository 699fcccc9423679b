"""`verify`: check a trajectory against its problem."""

from dataclasses import replace

from optiplan.problem.problem import Problem
from optiplan.problem.task.timeline import scene_parts
from optiplan.problem.task.tour_steps import chosen, in_order
from optiplan.robot.self_collision.pairs import count_reasons
from optiplan.trajectory.given_files import GivenFiles
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify import limit_checks
from optiplan.verify.collision_check import checked_robot, collision
from optiplan.verify.constraint_check import path_constraints
from optiplan.verify.file_checks import file_checks, names, unread_keys
from optiplan.verify.report import Check, Report, VerifyPolicy
from optiplan.verify.scope import scope
from optiplan.verify.statements import choices, complete, covering, tours
from optiplan.verify.tasks.choice_check import choice_checks, choice_scope
from optiplan.verify.tasks.task_check import loaded_torque, task_checks, task_scope
from optiplan.verify.tasks.tool_check import tool_checks, tool_scope
from optiplan.verify.tasks.tour_check import tour_checks, tour_scope
from optiplan.verify.via_check import vias

_DEFAULT = VerifyPolicy()


def verify(
    problem: Problem, trajectory: Trajectory, policy: VerifyPolicy = _DEFAULT, given: GivenFiles | None = None
) -> Report:
    """Check a trajectory against every requirement of its problem; a bad trajectory is refused, never an exception.

    Args:
        problem: the problem.
        trajectory: the trajectory, of any origin.
        policy: tolerances.
        given: what stands in the files of the trajectory beside its pieces, to be checked against them.

    Returns:
        Every check with its worst value, limit, time and place; those that need a well-formed trajectory of the right
        joints are left out, and said to be, when it is not one.
    """
    found = [limit_checks.form(trajectory)]
    if found[0].passed:
        found.append(limit_checks.joints(problem, trajectory))
    robot = checked_robot(problem, policy)
    report = Report(
        policy,
        tuple(found),
        dict(robot.link_geometry),
        robot.notes,
        unchecked_pairs=count_reasons(robot.allowed),
        links_without_geometry=robot.bare_links,
        over_cover=dict(robot.over_cover),
        tracking_error=tuple(problem.tracking_error.tolist()) if problem.tracking_error.any() else (),
    )
    if not all(check.passed for check in found):
        nothing = "nothing else was checked: the trajectory cannot be read as a motion of this robot"
        return replace(report, notes=(*robot.notes, nothing))
    whole, stated, problem = problem, chosen(problem, trajectory), in_order(problem, trajectory)
    found += [*choice_checks(whole, trajectory), *tour_checks(stated, trajectory)]
    found += task_checks(problem, trajectory, policy) if problem.task else _motion(problem, trajectory, policy)
    if problem.task or trajectory.segments:
        found.append(names(problem, trajectory))
    if given is not None:
        found += file_checks(problem, trajectory, policy, given)
    found += tool_checks(problem, trajectory)
    if not problem.task:
        found += [collision(part.problem, trajectory, policy) for part in scene_parts(problem, trajectory)]
    if all(check.passed for check in found):
        found.append(complete(problem, found, [*choices(whole), *tours(stated)]))
    about = (
        *scope(problem, robot, found),
        *(() if given is None else unread_keys(given)),
        *tool_scope(problem, trajectory),
    )
    if problem.task:
        about = (*about, *choice_scope(whole, trajectory), *tour_scope(stated, trajectory))
        about = (*about, *task_scope(problem, trajectory))
    return replace(report, checks=tuple(found), scope=about)


def holds(problem: Problem, trajectory: Trajectory) -> bool:
    """Whether `verify` accepts a trajectory; one with other ends is refused without a proof of the rest."""
    if not (limit_checks.form(trajectory).passed and limit_checks.joints(problem, trajectory).passed):
        return False
    ends = (limit_checks.start_position, limit_checks.rest)
    if not all(check(problem, trajectory, _DEFAULT).passed for check in ends):
        return False
    return limit_checks.goal(problem, trajectory).passed and verify(problem, trajectory).verified


def _motion(problem: Problem, trajectory: Trajectory, policy: VerifyPolicy) -> list[Check]:
    passed = [f"vias[{k}]" for k in range(len(problem.vias))]
    return [
        limit_checks.start_position(problem, trajectory, policy),
        covering(limit_checks.goal(problem, trajectory), "goal"),
        *([covering(vias(problem, trajectory), *passed)] if problem.vias else []),
        *path_constraints(problem, trajectory, policy),
        *limit_checks.of_the_whole(problem, trajectory, policy),
        loaded_torque(problem, trajectory, policy),
    ]
