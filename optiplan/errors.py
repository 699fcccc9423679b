"""Errors of OptiPlan: one root, every child carries fields and says what would be valid.

An invalid *input* is an exception from this file. "No solution" is a value: see `planners.base.Failure`.
"""

import os
import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from difflib import get_close_matches
from numbers import Integral
from pathlib import Path
from typing import NoReturn

from optiplan.records import dataclass


class OptiPlanError(Exception):
    """Root of every error that OptiPlan raises on purpose; the command line turns it into exit code 2."""


class OfOneProcess:
    """Base of what holds threads, sockets or native objects: it is refused in plain words where it is pickled."""

    def __reduce__(self) -> NoReturn:
        """Raise a TypeError, as other objects do that cannot be pickled or copied."""
        name = f"op.{type(self).__name__}"
        raise TypeError(f"{name} belongs to its process, and can be neither pickled nor copied: make another one there")


def plain_reason(error: BaseException) -> str:
    """Return an exception's message in one line, without the paths, functions and lines of C++ sources.

    Pinocchio and coal raise texts such as `From file: …/mesh.cpp … in function: … at line: 87 message: no vertices`.
    """
    text = " ".join(str(error).split())
    text = re.sub(r"^.*?\bat line:? ?\d+.*?\bmessage:? ", "", text, flags=re.IGNORECASE)
    text = re.sub(r"\S+\.(?:hpp|hxx|h|cpp|cc|cxx)(?:[:(]\d+\)?)?:?\s*", "", text)
    return text.strip() or type(error).__name__


def os_reason(error: OSError) -> str:
    """Return why the system refused something, in its words for a sentence."""
    text = error.strerror or str(error)
    return text[:1].lower() + text[1:]


def named_reason(error: BaseException) -> str:
    """Return an exception's class and message in one line."""
    text = " ".join(str(error).split())
    return f"{type(error).__name__}: {text}" if text else type(error).__name__


class UnknownChoiceError(OptiPlanError):
    """A name that is not among the valid ones."""

    def __init__(self, kind: str, found: str, choices: Iterable[str]) -> None:
        self.kind, self.found, self.choices = kind, found, tuple(sorted(choices))
        near = get_close_matches(str(found), [choice.partition(" (")[0] for choice in self.choices], n=1)
        self._listed = ", ".join(self.choices) + (f" (did you mean '{near[0]}'?)" if near else "")
        super().__init__(f"unknown {kind} '{found}'; choose from: {self._listed}")

    def of_argument(self, function: str, argument: str) -> "InputError":
        """Return the error about an argument of a function of the front door."""
        return wrong_argument(function, argument, f"'{self.found}'", f"one of: {self._listed}")

    def __reduce__(self) -> tuple[type["UnknownChoiceError"], tuple[str, str, tuple[str, ...]]]:
        """How to pickle it, for processes that hand it back."""
        return type(self), (self.kind, self.found, self.choices)


@dataclass(frozen=True)
class Issue:
    """One error in an input, with its location.

    Attributes:
        file: the file, or the planner or function that the option or argument belongs to.
        line: of the file, from 1; None where there is none.
        field: the field in words, such as `goal.pose.position[2]`; empty where several arguments do not fit each other.
        found: the value found.
        expected: the values allowed.
        path: the field as data: keys and indices from the root of the file; empty outside files.
        planner: planner whose option `field` is, where no file is known yet.
        function: function whose argument `field` is.
    """

    file: str
    line: int | None
    field: str
    found: str
    expected: str
    path: tuple[str | int, ...] = ()
    planner: str | None = None
    function: str | None = None

    @classmethod
    def of_option(cls, planner: str, option: str, found: str, expected: str) -> "Issue":
        """Return an issue about an option of a planner."""
        return cls(f"planner '{planner}'", None, option, found, expected, planner=planner)

    @classmethod
    def of_argument(cls, function: str, argument: str, found: str, expected: str) -> "Issue":
        """Return an issue about an argument of a function of the front door."""
        return cls(f"op.{function}", None, argument, f"found {found}", expected, function=function)

    def __str__(self) -> str:
        """Return `file:line: field: found …; expected …`, a form that editors turn into a link."""
        place = self.file if self.line is None else f"{self.file}:{self.line}"
        return ": ".join(filter(None, (place, self.field, f"{self.found}; expected {self.expected}")))


def described(value: object) -> str:
    """Describe an argument of the wrong type in a few words: `the int 3`, `an array of shape (2, 3)`."""
    try:
        shape, text = getattr(value, "shape", None), " ".join(repr(value).split())
    except Exception:  # an object may raise anything when it is asked for its text
        return f"the {type(value).__name__}"
    if isinstance(shape, tuple) and shape:
        return f"an array of shape {shape}"
    return "None" if value is None else f"the {type(value).__name__} {text if len(text) <= 60 else text[:59] + '…'}"


def counted(count: int, what: str) -> str:
    """Return how many there are in words: `1 piece`, `2 pieces`."""
    return f"{count} {what}{'s' * (count != 1)}"


def wrong_argument(function: str, argument: str, found: str, expected: str) -> "InputError":
    """Return the error for one argument of a Python call: `op.plan: budget: found -1.0; expected …`."""
    return InputError([Issue.of_argument(function, argument, found, expected)])


def path_argument(function: str, argument: str, value: object, expected: str) -> Path:
    """An argument as a path.

    Raises:
        InputError: it is none, or one that no file can have.
    """
    try:
        usable = isinstance(value, str | Path) and value != "" and b"\0" not in os.fsencode(value)
    except UnicodeEncodeError:
        usable = False
    if not usable:
        raise wrong_argument(function, argument, described(value), expected)
    return Path(value)  # type: ignore[arg-type]  # it is text or a path


def choice_argument(function: str, argument: str, value: object, choices: Collection[str]) -> None:
    """Require one of some words.

    Raises:
        InputError: another value, of whatever type.
    """
    if not isinstance(value, str) or value not in choices:
        raise wrong_argument(function, argument, described(value), f"one of: {', '.join(choices)}")


def flag_argument(function: str, argument: str, value: object) -> None:
    """Require True or False, also numpy's.

    Raises:
        InputError: another value.
    """
    numpys = getattr(getattr(value, "dtype", None), "kind", "") == "b" and getattr(value, "shape", None) == ()
    if not isinstance(value, bool) and not numpys:
        raise wrong_argument(function, argument, described(value), "True or False")


def text_argument(function: str, argument: str, value: object, expected: str) -> None:
    """Require text, or None.

    Raises:
        InputError: another value.
    """
    if value is not None and not isinstance(value, str):
        raise wrong_argument(function, argument, described(value), expected)


def progress_argument(function: str, value: object, expected: str = "a function of a name and a fraction") -> None:
    """Require a function for the argument `progress`, or None.

    Raises:
        InputError: another value.
    """
    if value is not None and not callable(value):
        raise wrong_argument(function, "progress", described(value), expected)


def whole_argument(
    function: str, argument: str, value: object, least: int, expected: str = "", *, most: int | None = None
) -> None:
    """Require a whole number of Python's, from `least` to `most`.

    Raises:
        InputError: another value; `expected` is in place of the usual words.
    """
    if isinstance(value, bool) or not isinstance(value, int) or value < least or (most is not None and value > most):
        usual = f"a whole number {f'>= {least}' if most is None else f'from {least} to {most}'}"
        raise wrong_argument(function, argument, described(value), expected or usual)


def options_argument(function: str, value: object) -> None:
    """Require options of a planner by name, or None.

    Raises:
        InputError: another value.
    """
    if value is not None and not isinstance(value, Mapping):
        raise wrong_argument(function, "options", described(value), "options by name, such as {'degree': 5}")


def seed_argument(function: str, value: object) -> int:
    """Return an argument as a seed.

    Raises:
        InputError: it is no whole number from 0 upwards.
    """
    if isinstance(value, bool) or not isinstance(value, Integral) or value < 0:
        raise wrong_argument(function, "seed", described(value), "a whole number >= 0")
    return int(value)


@contextmanager
def writing(function: str, path: Path | str, argument: str = "path") -> Iterator[None]:
    """Turn an `OSError` within into an `InputError` about an argument, the path of a file that is written."""
    try:
        yield
    except OSError as error:
        found = f"{str(path)!r} ({os_reason(error)})"
        raise wrong_argument(function, argument, found, "a file that can be written") from None


class InputError(OptiPlanError):
    """Invalid file or argument; holds *all* issues found, each once, in file order."""

    def __init__(self, issues: Iterable[Issue]) -> None:
        self.issues = tuple(dict.fromkeys(issues))
        super().__init__("\n".join(map(str, self.issues)))

    def __reduce__(self) -> tuple[type["InputError"], tuple[tuple[Issue, ...]]]:
        """How to pickle it, for processes that hand it back."""
        return type(self), (self.issues,)

    def about(self, file: str, name: str) -> "InputError":
        """Return the same error with `name` in place of that pseudo file name in its issues."""
        return type(self)(
            replace(issue, file=name) if Path(issue.file).name == file else issue for issue in self.issues
        )


@contextmanager
def errors_about(file: str, name: str) -> Iterator[None]:
    """Let issues about that pseudo file be about `name`, which is what the caller knows."""
    try:
        yield
    except InputError as error:
        raise error.about(file, name) from None


@contextmanager
def words_of_call(call: str, words: Mapping[str, str]) -> Iterator[None]:
    """Let an error name a Python call, and its arguments in place of the options of the command line.

    Args:
        call: such as `op.bench`.
        words: of the command line, and what the call has in their place.
    """
    try:
        yield
    except InputError as error:
        issues = []
        for issue in error.issues:
            expected = issue.expected
            for option, argument in words.items():
                expected = expected.replace(option, argument)
            issues.append(replace(issue, file=f"{call}: {issue.file}", expected=expected))
        raise InputError(issues) from None


class PlannerAnswerError(InputError):
    """A planner from outside returned what is no answer; in comparisons a bug of that planner."""
