"""Lower bound by which the durations of several runs of one problem are divided."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from optiplan.arrays import Array
from optiplan.problem.goals import listed_ends
from optiplan.problem.problem import JointGoal, Problem
from optiplan.runs.run import SMALLEST_BOUND
from optiplan.trajectory.segments import RESTING, TOUR, Segment
from optiplan.trajectory.state import State
from optiplan.trajectory.timing.lower_bound import lower_bound, moving_bounds
from optiplan.trajectory.trajectory import Trajectory


class Bound(NamedTuple):
    """Lower bound by which all durations of a comparison are divided, s, and what it is the least of."""

    seconds: float | None
    words: str

    def ratio(self, duration: float | None) -> float | None:
        """Duration, s, / bound; None without a motion, or where the robot need not move."""
        return None if duration is None or self.seconds is None else duration / self.seconds


def common_bound(problem: Problem, reached: Sequence[Array]) -> Bound:
    """Return the lower bound of a problem whose verified runs ended in the configurations `reached`, each (n,).

    No motion to an end configuration is shorter than its bound. Of the problem it is the least over the end
    configurations that were reached and those that the problem lists.
    """
    if problem.task:
        return Bound(None, "of a task each motion has its own: that of the places where it stops")
    listed = listed_ends(problem)
    if not listed and not len(reached):
        return Bound(None, "not known: no goal configuration is listed, and none was reached")
    seconds = float(problem.lower_bounds([*listed, *reached]).min())
    if seconds < SMALLEST_BOUND:
        return Bound(None, "none: the robot need not move")
    if all(isinstance(goal, JointGoal) for goal in problem.goal):
        count = len(problem.goal)
        words = "of the goal" if count == 1 else f"the least over the {count} goals of the problem"
    else:
        words = "the least over the end configurations reached here; others may have a lower one"
    return Bound(seconds, words)


def duration_bound(problem: Problem, trajectory: Trajectory) -> float:
    """Return the lower bound, s, of a motion's duration: of its end, or of all that a task must do at rest.

    Of a task: the sum over the stretches between the steps before and after which the robot stands still, each from
    rest (or the moving start) to rest; what grippers and dwelling take is counted whole. It rests at targets of tours.
    Of several arms it is the sum of the slowest. Where the robot goes with what moves, it is not at rest: only its
    speed limits bound a stretch that begins or ends there.
    """
    if not problem.task:
        return float(problem.lower_bounds([trajectory.end])[0])
    from optiplan.problem.task.arms import in_task_order, joints_of_arms, several_arms, steps_of_arms
    from optiplan.problem.task.tour_steps import in_order

    segments, of_arms = in_task_order(problem.task, trajectory.segments), steps_of_arms(problem.task)
    columns = joints_of_arms(problem.task, problem.robot.joint_names)
    if not several_arms(problem.task):
        steps = in_order(problem, trajectory).task
        rides = [segments[k].begin for k, step in enumerate(steps) if step.ride is not None and k < len(segments)]
        ends = [segments[k].end for k, step in enumerate(steps) if step.ride is not None and k < len(segments)]
        return _least_of(problem, trajectory, segments, columns[""], frozenset([*rides, *ends]))
    return max(
        _least_of(problem, trajectory, [segments[k] for k in places], columns[arm]) for arm, places in of_arms.items()
    )


def _least_of(
    problem: Problem,
    trajectory: Trajectory,
    segments: Sequence[Segment],
    columns: list[int],
    moving: frozenset[float] = frozenset(),
) -> float:
    """Return the least time, s, that steps in a row take, of the joints that they move; `moving`: at these times."""
    total, begin = 0.0, 0.0
    for segment in segments:
        if segment.kind in RESTING:
            total += _least(problem, trajectory, (begin, segment.begin), columns, moving)
            total += segment.end - segment.begin
            begin = segment.end
        elif segment.kind == TOUR:
            total += _least(problem, trajectory, (begin, segment.end), columns, moving)
            begin = segment.end
    return total + _least(problem, trajectory, (begin, trajectory.duration), columns, moving)


def _least(
    problem: Problem,
    trajectory: Trajectory,
    between: tuple[float, float],
    columns: list[int],
    moving: frozenset[float] = frozenset(),
) -> float:
    """Return the least time, s, from where a motion is at one time to where it is at another; from rest to rest.

    At the start the robot may be moving, as its problem says, and at the times of `moving` at any speed.
    """
    begin, end = between
    q, last = trajectory(begin), trajectory(begin)
    last[columns] = trajectory(end)[columns]
    if moving & {begin, end}:
        return float((np.abs(last - q) / problem.limits.velocity).max())
    if begin == 0.0 and problem.moving_start:
        return float(moving_bounds(problem.start_state, [State(last)], problem.limits).min())
    return lower_bound(q, last, problem.limits)
