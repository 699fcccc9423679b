"""The program `optiplan`: its commands and error handling."""

import errno
import gc
import os
import re
import signal
import sys
import tempfile
import traceback
import warnings
from collections.abc import Sequence
from importlib import import_module
from io import BufferedWriter, FileIO, TextIOWrapper
from typing import Any

import typer
from typer.core import TyperGroup

from optiplan.cli.output import Exit, end_with, file_error, print_error, print_json, report_error
from optiplan.cli.program import program
from optiplan.errors import InputError, Issue, OptiPlanError

STDOUT_LOST = (errno.ENOSPC, errno.EIO, errno.EBADF, errno.EFBIG, errno.EDQUOT)
"""Errors without a file name by which writing to stdout fails: a full disk, a terminal that is gone."""

USAGE = {
    "Input should be a valid number, .*": "expected a number",
    "Input should be a valid integer, .*": "expected a whole number",
    "Input should be greater than or equal to ": "expected a number ≥ ",
    "Input should be less than or equal to ": "expected a number ≤ ",
}
"""What typer says of the value of an option, and what we say."""

NO_COMMAND = re.compile(r"No such command '.*'\.")
"""Of typer, where no name is near the one that was given."""

NO_ANSWER = "no answer; expected one, or the options that say what is asked for"
"""Where the input ends at a question."""

COMPLETION = ("--install-completion", "--show-completion")
"""Typer's own: they work for the shell that calls, and end with 1 where there is none."""

NOT_THERE = re.compile(r"(\S+\.so[.\d]*): cannot open shared object file")
DEBIAN = {"libgomp.so.1": "libgomp1", "libstdc++.so.6": "libstdc++6", "libGL.so.1": "libgl1", "libX11.so.6": "libx11-6"}
"""Packages of the libraries that ours ask of the system."""

YOUNG_OBJECTS = 200_000
"""New objects between two looks for garbage: importing makes 100,000 that all stay, and Python looks after 700."""


def main() -> None:
    """Run the program on the arguments of this process and end it.

    Ctrl-C ends the process at once, even inside a solver: the system's default handler does not need the interpreter.
    Nothing is lost by that, since files are written atomically.
    """
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    gc.set_threshold(YOUNG_OBJECTS)
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")  # or pydantic asks every installed package for some
    if "OPENBLAS_NUM_THREADS" not in os.environ:  # before numpy: starting its threads takes longer than our matrices do
        os.environ.setdefault("OMP_NUM_THREADS", "1")
    _open_streams()
    if not os.environ.get("OPTIPLAN_DEBUG"):
        warnings.simplefilter("ignore", RuntimeWarning)  # overflowing numbers are reported by the checks
    code = run(sys.argv[1:])
    if "ompl" not in sys.modules:  # without a last look for garbage its classes would complain of being leaked
        gc.freeze()
    sys.exit(code)


def _open_streams() -> None:
    """Replace a stdout or stderr that was closed before the start (`>&-`) by the null device, or whose reader goes.

    Characters that the encoding of stdout lacks, as · and ≥, become question marks; stderr writes their numbers.
    """
    for number, name, errors in ((1, "stdout", "replace"), (2, "stderr", "backslashreplace")):
        stream = getattr(sys, name)
        if stream is None:
            _lose(number)
        lines = stream is not None and (stream.line_buffering or stream.write_through)
        encoding = None if stream is None else stream.encoding
        writer = BufferedWriter(_Output(number, "w", closefd=False))
        setattr(sys, name, TextIOWrapper(writer, encoding, errors, line_buffering=lines))


class _Output(FileIO):
    """Takes what is written also after the reader has gone, as `head` does: that is no fault of the run."""

    def write(self, content: Any) -> int:
        try:
            return super().write(content)
        except BrokenPipeError:
            _lose(self.fileno())
            return super().write(content)


def _lose(number: int) -> None:
    """Have a file descriptor write to the null device."""
    opened = os.open(os.devnull, os.O_WRONLY)
    if opened != number:
        os.dup2(opened, number)
        os.close(opened)


def run(arguments: Sequence[str]) -> int:
    """Run one command and return its exit code; no exception leaves, unless OPTIPLAN_DEBUG is set."""
    as_json = "--json" in arguments
    try:
        _refuse_empty_values(arguments)
        if not {"--help", "--version"}.intersection(arguments or ["--help"]):
            import_module("numpy")  # before typer's pydantic, whose changes to `typing` would cost it 50 ms
        app = program(arguments[0] if arguments else None)
        code = int(app(list(arguments) or ["--help"], prog_name="optiplan", standalone_mode=False) or 0)
        return _without_shell() if code and set(arguments) & set(COMPLETION) else code
    except (typer.TyperException, typer.Abort) as error:  # the command line is wrong, or a question has no answer
        return _usage(error, as_json)
    except OptiPlanError as error:
        report_error(error, as_json)
        return Exit.BAD_INPUT
    except OSError as error:
        if error.filename is None and error.errno in STDOUT_LOST:
            print_error(f"optiplan: the output cannot be written: {error.strerror or error}")
            _lose(1)
            return Exit.BUG
        report_error(file_error(error), as_json)
        return Exit.BAD_INPUT
    except Exception as error:
        if os.environ.get("OPTIPLAN_DEBUG"):
            raise
        missing = isinstance(error, ImportError) and NOT_THERE.match(str(error))
        if missing:  # a small system, such as that of a container
            report_error(_missing_library(missing[1]), as_json)
            return Exit.BAD_INPUT
        return _bug(error, as_json)


def _missing_library(name: str) -> InputError:
    package = DEBIAN.get(name)
    cure = "it installed" + (f" (Debian, Ubuntu: apt install {package})" if package else "")
    return InputError([Issue("this system", None, name, "no such library", cure)])


def _without_shell() -> int:
    print_error("optiplan: not called from a shell; expected bash, zsh, fish or PowerShell")
    return Exit.BAD_INPUT


def _refuse_empty_values(arguments: Sequence[str]) -> None:
    """Refuse empty values, as of a variable that is not set: some would be taken for the folder one is in."""
    for k, value in enumerate(arguments):
        if not value or (value.startswith("--") and value.endswith("=")):
            place = f"of {value[:-1]}" if value else f"after {arguments[k - 1]}" if k else "in place of a command"
            raise typer.BadParameter(f"an empty value {place}; expected a word")


def _usage(error: typer.TyperException | typer.Abort, as_json: bool) -> int:
    context = getattr(error, "ctx", None)
    command = context.command_path if context is not None else "optiplan"
    text = NO_ANSWER if isinstance(error, typer.Abort) else error.format_message()
    for theirs, ours in USAGE.items():
        text = re.sub(theirs, ours, text)
    if context is not None and isinstance(context.command, TyperGroup) and NO_COMMAND.fullmatch(text):
        text += f" Choose from: {', '.join(context.command.list_commands(context))}."
    text = text or "no command"
    if as_json:
        print_json({"error": text, "issues": [], "exit_code": int(Exit.BAD_INPUT)})
    else:
        print_error(f"{command}: {text}\nsee: {command} --help")
    return Exit.BAD_INPUT


def _bug(error: Exception, as_json: bool) -> int:
    """Report an internal error: one line on stderr, the traceback in a file for the bug report."""
    handle, path = tempfile.mkstemp(prefix="optiplan-", suffix=".log")
    with os.fdopen(handle, "w", encoding="utf-8") as file:
        traceback.print_exception(error, file=file)
    text = f"internal error, please report it: {type(error).__name__}: {error} (traceback in {path})"
    return end_with(Exit.BUG, text, as_json)
