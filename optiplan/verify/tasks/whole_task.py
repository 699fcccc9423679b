"""Checks and scope of a motion that does a task: its alternatives, its tours and its steps."""

from collections.abc import Iterator

from optiplan.config.messages import some
from optiplan.problem.problem import Problem
from optiplan.problem.task.choices import choices_of, taken_by
from optiplan.problem.task.steps import TargetTour
from optiplan.problem.task.timeline import mismatch
from optiplan.problem.task.tour_order import wrong_order
from optiplan.problem.task.tour_steps import arrivals, chosen, in_order
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.report import Check, VerifyPolicy
from optiplan.verify.statements import choice, choices, covering, tour, tours
from optiplan.verify.tasks.task_check import task_checks, task_scope
from optiplan.verify.tasks.task_parts import step_parts

_NAMED = 12
"""Targets of a tour that a report names, in their order."""


class WholeTask:
    """A task and a motion.

    Attributes:
        in_order: the problem with the alternatives that the motion does, and with the steps of tours in its order.
    """

    def __init__(self, problem: Problem, trajectory: Trajectory) -> None:
        self._problem, self._trajectory = problem, trajectory
        self._chosen, self.in_order = chosen(problem, trajectory), in_order(problem, trajectory)
        done = not mismatch(self.in_order, trajectory)
        self._parts = list(step_parts(self.in_order, trajectory)) if done else []

    def checks(self, policy: VerifyPolicy) -> list[Check]:
        """Return the checks of alternatives, tours and steps."""
        return [
            *choice_checks(self._problem, self._trajectory),
            *tour_checks(self._chosen, self._trajectory),
            *task_checks(self.in_order, self._trajectory, self._parts, policy),
        ]

    def statements(self) -> list[str]:
        """Return the statements of alternatives and tours, which the problem in the order of the motion lacks."""
        return [*choices(self._problem), *tours(self._chosen)]

    def scope(self) -> tuple[str, ...]:
        """Return what the verdict is about besides."""
        return (
            *choice_scope(self._problem, self._trajectory),
            *tour_scope(self._chosen, self._trajectory),
            *task_scope(self.in_order, self._trajectory, self._parts),
        )


def choice_checks(problem: Problem, trajectory: Trajectory) -> Iterator[Check]:
    """Yield the check of each choice: steps of one alternative are done, of all others none.

    That its steps are done as they are stated is checked as of any step.
    """
    known = choices_of(problem.task)
    taken, unclear = taken_by(problem.task, [one.step for one in trajectory.segments])
    for number, alternatives in known.items():
        wrong = number in unclear
        words = "not the steps of one alternative alone" if wrong else f"alternative {taken[number] + 1}"
        detail = f"choice {number + 1}: {words}, of {len(alternatives)}"
        yield covering(Check("either", "exact", not wrong, detail=detail), choice(number))


def choice_scope(problem: Problem, trajectory: Trajectory) -> tuple[str, ...]:
    """Return which alternatives a motion does."""
    known = choices_of(problem.task)
    taken, _ = taken_by(problem.task, [one.step for one in trajectory.segments])
    said = []
    for number, alternatives in known.items():
        own = [step for step in problem.task if step.option == (number, taken[number])]
        said.append(f"alternative {taken[number] + 1} of {len(alternatives)} from {own[0].words} on")
    return (f"taken: {'; '.join(said)}",) if said else ()


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


def tour_scope(problem: Problem, trajectory: Trajectory) -> tuple[str, ...]:
    """Return in what order the motion visits the targets of each tour."""
    said = []
    for step in problem.task:
        if isinstance(step.action, TargetTour):
            names = list(arrivals(step.action, [one for one in trajectory.segments if one.step == step.number]))
            said.append(f"{step.words} visits: {some(names, _NAMED)}")
    return tuple(said)
