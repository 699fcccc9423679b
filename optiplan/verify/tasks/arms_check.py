"""The check of arms beside each other: they stand still between their steps, and wait for each other where stated."""

from collections.abc import Iterator

from optiplan.problem.problem import Problem
from optiplan.problem.task.arms import in_task_order, joints_of_arms, several_arms, steps_of_arms, unmet_waits
from optiplan.trajectory.joining import cut_trajectory
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.report import Check, VerifyPolicy
from optiplan.verify.statements import arms, covering, step_place


def arms_check(problem: Problem, trajectory: Trajectory, policy: VerifyPolicy) -> list[Check]:
    """Return the check of a task of several arms; none of another.

    Outside its steps each joint of an arm moves by no more than `jump_tolerance`, from the exact extrema, and joints of
    no arm never do. *Holds at* all times. Every step begins at or after the end of each step for which it waits.
    """
    if not several_arms(problem.task):
        return []
    segments = in_task_order(problem.task, trajectory.segments)
    failed = next(unmet_waits(problem.task, segments), "")
    worst, when, where = 0.0, 0.0, ""
    for arm, columns, begin, end in _idle(problem, trajectory):
        low, high = cut_trajectory(trajectory, begin, end).extrema(0)
        moved = float((high - low)[columns].max(initial=0.0))
        if moved > worst:
            worst, when, where = moved, begin, arm or "joints of no arm"
    waits = [f"{step_place(k)}.wait[{n}]" for k, step in enumerate(problem.task) for n in step.waits]
    detail = failed or f"{len(steps_of_arms(problem.task))} arms stand still between their steps; {len(waits)} waits"
    passed = worst <= policy.jump_tolerance and not failed
    check = Check("arms", "exact", passed, worst, policy.jump_tolerance, "rad or m", when, where, detail)
    return [covering(check, *arms(problem), *waits)]


def _idle(problem: Problem, trajectory: Trajectory) -> Iterator[tuple[str, list[int], float, float]]:
    """Yield the times, s, outside the steps of each arm, with its joints; and the whole of the joints of none."""
    T = trajectory.duration
    segments = in_task_order(problem.task, trajectory.segments)
    of_arms = joints_of_arms(problem.task, problem.robot.joint_names)
    for arm, places in steps_of_arms(problem.task).items():
        since = 0.0
        for begin, end in [*((segments[k].begin, segments[k].end) for k in places), (T, T)]:
            if begin > since:
                yield arm, of_arms[arm], since, begin
            since = max(since, end)
    others = sorted(set(range(problem.robot.n)) - {k for columns in of_arms.values() for k in columns})
    if others:
        yield "", others, 0.0, T
