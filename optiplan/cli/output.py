"""Output conventions of the commands: results on stdout, everything else on stderr, documented exit codes."""

import errno
import json
import os
import signal
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from enum import IntEnum
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from rich.console import Console

from optiplan.errors import InputError, Issue, OptiPlanError, os_reason

if TYPE_CHECKING:
    from rich.table import Table

UNWRAPPED = 1000
"""Columns of what is no terminal: other programs read lines, and wrapped ones are none."""

ENDS = (signal.SIGTERM, signal.SIGHUP)
"""Signals that end a process: from the system, and from a terminal that is closed."""


class Exit(IntEnum):
    """Exit codes; `docs/reference/exit-codes.md` has the same table."""

    VERIFIED = 0
    BUG = 1
    BAD_INPUT = 2
    NO_PLAN = 3
    NOT_VERIFIED = 4
    INTERRUPTED = 130


def results() -> Console:
    """Return a console on stdout, made at each use so that it follows redirections."""
    return Console(highlight=False, width=_width(sys.stdout))


def messages() -> Console:
    """Console on stderr."""
    return Console(stderr=True, highlight=False, width=_width(sys.stderr))


def _width(stream: TextIO) -> int | None:
    """Return the columns of a stream: those of the terminal; `UNWRAPPED` of a pipe or file, or what COLUMNS says."""
    return None if stream.isatty() or "COLUMNS" in os.environ else UNWRAPPED


def plain_table(words: Sequence[str], numbers: Sequence[str] = ()) -> "Table":
    """Return a table without lines: columns of words with these headings, then columns of numbers."""
    from rich.table import Table

    table = Table(*words, box=None, pad_edge=False, header_style="dim")
    for heading in numbers:
        table.add_column(heading, justify="right")
    return table


def say(text: str, style: str | None = None) -> None:
    """Print lines on stdout as they are: no markup, and no wrapping, so that a path stays one word."""
    results().print(text, style=style, markup=False, soft_wrap=True)


def print_json(data: Mapping[str, Any]) -> None:
    """Print the JSON object of a command in --json mode; what is not finite is null there."""
    from optiplan.verify.report import jsonable

    sys.stdout.write(json.dumps(jsonable(data), allow_nan=False) + "\n")
    sys.stdout.flush()


def print_error(text: str) -> None:
    """Print an error without wrapping, so that `file:line:` stays a link."""
    messages().print(text, style="red", markup=False, soft_wrap=True)


def report_error(error: OptiPlanError, as_json: bool) -> None:
    """Print all issues, as lines or as a JSON object with `error` and `issues`."""
    if as_json:
        issues = [vars(issue) for issue in error.issues] if isinstance(error, InputError) else []
        print_json({"error": str(error), "issues": issues, "exit_code": int(Exit.BAD_INPUT)})
    else:
        print_error(f"optiplan: {error}" if not isinstance(error, InputError) else str(error))


def file_error(error: OSError) -> InputError:
    """Return the error about a file that a person named and that cannot be read or written."""
    expected = "a file, not a folder" if error.errno == errno.EISDIR else "one that can be read or written"
    found = os_reason(error)
    return InputError([Issue(str(error.filename or "file"), None, "file", found, expected)])


@contextmanager
def stdout_is_ours() -> Iterator[None]:
    """Redirect to stderr what C++ libraries write to file descriptor 1 meanwhile."""
    sys.stdout.flush()
    kept = os.dup(1)
    os.dup2(2, 1)
    try:
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)


@contextmanager
def handling(ends: Sequence[int], handler: Callable[[int, Any], object]) -> Iterator[None]:
    """Handle these signals so meanwhile."""
    before = [(end, signal.signal(end, handler)) for end in ends]
    try:
        yield
    finally:
        for end, was in before:
            signal.signal(end, was)


@contextmanager
def interruptible() -> Iterator[None]:
    """Let Ctrl-C raise KeyboardInterrupt meanwhile, for commands that keep what they have by then."""
    with handling((signal.SIGINT,), signal.default_int_handler):
        yield


def end_with(code: Exit, why: str, as_json: bool) -> Exit:
    """Print why a command that has nothing to show ends with this code, and return it."""
    if as_json:
        print_json({"error": why, "issues": [], "exit_code": int(code)})
    else:
        print_error(f"optiplan: {why}")
    return code


def tell_interrupted(words: str, as_json: bool) -> int:
    """Say that Ctrl-C ended a command that has nothing to show, and what is kept; return `INTERRUPTED`."""
    return end_with(Exit.INTERRUPTED, f"interrupted: {words}", as_json)


@contextmanager
def interrupts_held() -> Iterator[None]:
    """Defer Ctrl-C and `ENDS`: they may end the process between two runs, not between the two files of one.

    Uses handlers, not a signal mask: threads of libraries would take the signal.
    """
    pressed: list[int] = []
    try:
        with handling((signal.SIGINT, *ENDS), lambda number, _: pressed.append(number)):
            yield
    finally:
        for number in pressed[:1]:
            signal.raise_signal(number)


def saved(save: Callable[[], Sequence[Path] | None], unsaved: list[InputError]) -> list[str]:
    """Save a result without an interrupt, and return its files; what prevents that is added to `unsaved`."""
    try:
        with interrupts_held():
            return [str(path) for path in save() or ()]
    except InputError as error:
        unsaved.append(error)
    except OSError as error:
        unsaved.append(file_error(error))
    return []


def show_result(
    data: Mapping[str, Any], show: Callable[[], object], code: int, as_json: bool, unsaved: Sequence[InputError] = ()
) -> int:
    """Print a result, as JSON or by `show`, even where it could not be saved; return its exit code, which is 2 then."""
    code = int(Exit.BAD_INPUT if unsaved else code)
    if as_json:
        lost = {"error": "\n".join(map(str, unsaved))} if unsaved else {}
        print_json({**data, **lost, "exit_code": code})
    else:
        show()
    for error in unsaved:
        print_error(f"not saved: {error}")
    return code
