"""Check that of the alternatives of a task a motion does one, and all of it."""

from collections.abc import Iterator

from optiplan.problem.problem import Problem
from optiplan.problem.task.choices import choices_of, taken_by
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.report import Check
from optiplan.verify.statements import choice, covering


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
