"""Check the order of tours: every target once, and before, after, first, last, in one go and in time as stated."""

from collections.abc import Iterator

from optiplan.config.messages import some
from optiplan.problem.problem import Problem
from optiplan.problem.task.steps import TargetTour
from optiplan.problem.task.tour_order import wrong_order
from optiplan.problem.task.tour_steps import arrivals
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.report import Check
from optiplan.verify.statements import covering, tour

_NAMED = 12
"""Targets of a tour that a report names, in their order."""


def tour_scope(problem: Problem, trajectory: Trajectory) -> tuple[str, ...]:
    """Return in what order the motion visits the targets of each tour."""
    said = []
    for step in problem.task:
        if isinstance(step.action, TargetTour):
            names = list(arrivals(step.action, [one for one in trajectory.segments if one.step == step.number]))
            said.append(f"{step.words} visits: {some(names, _NAMED)}")
    return tuple(said)


def tour_checks(problem: Problem, trajectory: Trajectory) -> Iterator[Check]:
    """Yield a check of each tour: the order and the times in which the motion's segments arrive at its targets.

    That the tool is at the targets then, and rests, is checked as of any move; see `tour_steps.in_order`.
    """
    for step in problem.task:
        if isinstance(step.action, TargetTour):
            own = [one for one in trajectory.segments if one.step == step.number]
            arrived = arrivals(step.action, own) if own else {}
            words = wrong_order(step.action, arrived)
            detail = f"{step.words}: {words or f'{len(arrived)} targets, each visited once, in an order as stated'}"
            yield covering(Check("tour", "exact", not words, detail=detail), tour(step))
