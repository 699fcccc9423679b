"""Alternatives of steps: which of them a motion does, and all tasks that they make."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import product

from optiplan.problem.task.steps import TaskStep

MOST = 32
"""Tasks that alternatives may make together."""


def choices_of(task: Sequence[TaskStep]) -> dict[int, list[int]]:
    """Return the alternatives of each choice, both by their numbers in the file."""
    found: dict[int, list[int]] = {}
    for step in task:
        if step.option is not None and step.option[1] not in found.setdefault(step.option[0], []):
            found[step.option[0]].append(step.option[1])
    return found


def with_choices(task: Sequence[TaskStep], taken: dict[int, int]) -> tuple[TaskStep, ...]:
    """Return the task in which of each choice one alternative is done."""
    return tuple(
        replace(step, option=None)
        for step in task
        if step.option is None or taken.get(step.option[0]) == step.option[1]
    )


def every_task(task: Sequence[TaskStep]) -> Iterator[dict[int, int]]:
    """Yield what may be taken of all choices together."""
    found = choices_of(task)
    for combined in product(*found.values()):
        yield dict(zip(found, combined, strict=True))


def taken_by(task: Sequence[TaskStep], numbers: Sequence[int]) -> tuple[dict[int, int], list[int]]:
    """Return what is taken of each choice by a motion that does the steps of these numbers, and where that is unclear.

    It is the first alternative of which a step is done. It is unclear where none is done, or parts of several are.
    """
    present = set(numbers)
    taken, unclear = {}, []
    for choice, alternatives in choices_of(task).items():
        own = {one: {step.number for step in task if step.option == (choice, one)} for one in alternatives}
        begun = [one for one in alternatives if own[one] & present]
        taken[choice] = begun[0] if begun else alternatives[0]
        if len(begun) != 1 or not own[begun[0]] <= present:
            unclear.append(choice)
    return taken, unclear
