"""`verify`: check a trajectory against its problem."""

from dataclasses import replace
from typing import TYPE_CHECKING

from optiplan.problem.problem import Problem
from optiplan.problem.task.scene_part import whole_motion
from optiplan.robot.self_collision.pairs import count_reasons
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify import limit_checks
from optiplan.verify.collision_check import checked_robot, collision
from optiplan.verify.report import Check, Report, VerifyPolicy
from optiplan.verify.scope import scope
from optiplan.verify.statements import bodies_of_file, complete, covering

if TYPE_CHECKING:
    from optiplan.trajectory.given_files import GivenFiles


_DEFAULT = VerifyPolicy()


def verify(
    problem: Problem, trajectory: Trajectory, policy: VerifyPolicy = _DEFAULT, given: "GivenFiles | None" = None
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
    stated, found = problem, [limit_checks.form(trajectory)]
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
    task = None
    if problem.task:
        from optiplan.verify.tasks.whole_task import WholeTask

        task = WholeTask(problem, trajectory)
        problem = task.in_order
    found += limit_checks.far_motions(problem, trajectory)
    found += _motion(problem, trajectory, policy) if task is None else task.checks(policy)
    about: tuple[str, ...] = ()
    if task is not None or trajectory.segments:
        from optiplan.verify.file_checks import names

        found.append(names(problem, trajectory))
    if given is not None:
        from optiplan.verify.file_checks import file_checks, sample_scope, unread_keys

        found += file_checks(problem, trajectory, policy, given)
        about = (*sample_scope(given), *unread_keys(given))
    if problem.tools:
        from optiplan.verify.tasks.tool_check import tool_checks, tool_scope

        found += tool_checks(problem, trajectory)
        about = (*about, *tool_scope(problem, trajectory))
    if task is None:
        found.append(collision(whole_motion(problem, trajectory).problem, trajectory, policy))
    if all(check.passed for check in found):
        besides = () if task is None else task.statements()
        found.append(complete(problem, found, [*bodies_of_file(stated), *besides]))
    about = (*scope(problem, robot, found), *about, *(() if task is None else task.scope()))
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
    return [
        limit_checks.start_position(problem, trajectory, policy),
        covering(limit_checks.goal(problem, trajectory), "goal"),
        *(_vias(problem, trajectory) if problem.vias else []),
        *(_path_constraints(problem, trajectory, policy) if problem.path_constraints else []),
        *limit_checks.of_the_whole(problem, trajectory, policy),
        limit_checks.loaded_torque(problem, trajectory, policy),
    ]


def _vias(problem: Problem, trajectory: Trajectory) -> list[Check]:
    from optiplan.verify.via_check import vias

    return [covering(vias(problem, trajectory), *(f"vias[{k}]" for k in range(len(problem.vias))))]


def _path_constraints(problem: Problem, trajectory: Trajectory, policy: VerifyPolicy) -> list[Check]:
    from optiplan.verify.constraint_check import path_constraints

    return path_constraints(problem, trajectory, policy)
