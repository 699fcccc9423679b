"""Errors of OptiPlan: one root, every child carries fields and says what would be valid.

A broken *input* is an exception from this file. "No solution" is a value: see `planners.base.Failure`.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from difflib import get_close_matches


class OptiPlanError(Exception):
    """Root of every error that OptiPlan raises on purpose; the command line turns it into exit code 2."""


class UnknownChoiceError(OptiPlanError):
    """A name that is not among the valid ones."""

    def __init__(self, kind: str, found: str, choices: Iterable[str]) -> None:
        self.kind, self.found, self.choices = kind, found, tuple(sorted(choices))
        near = get_close_matches(found, [choice.partition(" (")[0] for choice in self.choices], n=1)
        hint = f" (did you mean '{near[0]}'?)" if near else ""
        super().__init__(f"unknown {kind} '{found}'; choose from: {', '.join(self.choices)}{hint}")


@dataclass(frozen=True)
class Issue:
    """One thing that is wrong in an input file."""

    file: str
    line: int | None
    field: str
    found: str
    expected: str

    def __str__(self) -> str:
        """`file:line: field: found …; expected …`, the form that editors turn into a link."""
        place = self.file if self.line is None else f"{self.file}:{self.line}"
        return f"{place}: {self.field}: {self.found}; expected {self.expected}"


class InputError(OptiPlanError):
    """A problem, robot, run or scene file that cannot be used; holds *all* issues found, each once, in file order."""

    def __init__(self, issues: Iterable[Issue]) -> None:
        self.issues = tuple(dict.fromkeys(issues))
        super().__init__("\n".join(map(str, self.issues)))
