"""A tour as steps: the moves from target to target, in the order of a motion."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

from optiplan.arrays import Array
from optiplan.problem.goals_and_vias import JointGoal
from optiplan.problem.problem import Problem, derived
from optiplan.problem.seams.actions import SeamPath
from optiplan.problem.seams.seam_steps import seam_steps
from optiplan.problem.task.choices import taken_by, with_choices
from optiplan.problem.task.scene_change import columns
from optiplan.problem.task.steps import Dwell, Move, TargetTour, TaskStep
from optiplan.trajectory.segments import TOUR, Segment
from optiplan.trajectory.trajectory import Trajectory

BACK = "back"
"""Name of the move that closes a tour."""


def in_order(problem: Problem, trajectory: Trajectory) -> Problem:
    """Return the problem with tours and paths replaced by their steps, tours in the order in which the motion goes.

    That is the order of the names of its segments; where these are not all targets once, that of the list. Of
    alternatives it has those that the motion does.
    """
    problem = chosen(problem, trajectory)
    if not any(isinstance(step.action, TargetTour | SeamPath) for step in problem.task):
        return problem
    steps: list[TaskStep] = []
    for step in problem.task:
        if isinstance(step.action, TargetTour):
            own = [one for one in trajectory.segments if one.step == step.number]
            at = own[0].begin if own else -1.0
            within = 0.0 <= at <= trajectory.duration  # a motion that is not is refused, but not here
            begin = trajectory(at) if within else problem.start
            steps += tour_steps(step, step.action, _order(step.action, own), begin[columns_of(problem, step.action)])
        elif isinstance(step.action, SeamPath):
            steps += seam_steps(step, step.action)
        else:
            steps.append(step)
    return derived(problem, task=tuple(steps))


def chosen(problem: Problem, trajectory: Trajectory) -> Problem:
    """Return the problem with those of alternatives that a motion does, see `choices.taken_by`; itself without any."""
    if all(step.option is None for step in problem.task):
        return problem
    taken, _ = taken_by(problem.task, [one.step for one in trajectory.segments])
    return derived(problem, task=with_choices(problem.task, taken))


def columns_of(problem: Problem, tour: TargetTour) -> list[int]:
    """Return the places of the joints of a tour in a configuration of the robot."""
    return columns(problem.robot, tour.joints)


def tour_steps(step: TaskStep, tour: TargetTour, order: Sequence[int], begin: Array) -> Iterator[TaskStep]:
    """Yield the steps of a tour that visits its targets in an order, from a configuration `begin` (k,) of its joints.

    A move to each target, of the kind `tour` and with the target's name, and what is done there; `BACK` closes it. The
    constraints of the step hold during all of them.
    """
    for k in order:
        target = tour.targets[k]
        move = Move(tour.joints, (target.goal,), rests=True, carried_by=tour.carried_by)
        yield replace(step, kind=TOUR, name=target.name, action=move)
        for one in tour.at_each:
            kind = "process" if one.name else "dwell"
            yield replace(step, kind=kind, name=one.name or kind, action=Dwell(one.seconds))
    if tour.closed:
        yield replace(step, kind=TOUR, name=BACK, action=Move(tour.joints, (JointGoal(begin),), rests=True))


def arrivals(tour: TargetTour, segments: Sequence[Segment]) -> dict[str, float]:
    """Return when the motion arrives at each target, s from the start of the tour, in the order of the arrivals."""
    led = [one for one in segments if one.kind == TOUR][: len(tour.targets)]
    return {one.name: one.end - segments[0].begin for one in led}


def _order(tour: TargetTour, segments: Sequence[Segment]) -> list[int]:
    places = {target.name: k for k, target in enumerate(tour.targets)}
    found = [places.get(one.name, -1) for one in segments if one.kind == TOUR][: len(places)]
    return found if sorted(found) == list(range(len(places))) else list(range(len(places)))
