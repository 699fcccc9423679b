"""Print the progress of a suite: a bar in a terminal, plain lines now and then elsewhere."""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from optiplan.cli.output import messages

EVERY = 10.0
"""s between two lines where no person watches."""

Watch = Callable[[Any], None]
"""Told every outcome."""


class Pace:
    """Number and rate of the runs made."""

    def __init__(self, total: int, found: int) -> None:
        self.total = total
        self.done = found
        self._found = found
        self._good = 0
        self._began = time.perf_counter()

    def add(self, outcome: Any) -> None:
        """Count an outcome."""
        self.done += 1
        self._good += bool(outcome.row.verified)

    @property
    def rate(self) -> float:
        """Runs made in a second."""
        return (self.done - self._found) / max(time.perf_counter() - self._began, 1e-9)

    def words(self) -> str:
        """Rate and share of verified runs."""
        return f"{self.rate:.2f}/s, {100 * self._good / max(self.done - self._found, 1):.0f} % verified"


@contextmanager
def progress(total: int, found: int) -> Iterator[Watch]:
    """Show on stderr the number of runs done of `total`, `found` of them earlier."""
    pace = Pace(total, found)
    with _bar(pace) if sys.stderr.isatty() else _lines(pace) as watch:
        yield watch


@contextmanager
def _bar(pace: Pace) -> Iterator[Watch]:
    """A bar with rate and time left."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, ProgressColumn, TextColumn, TimeRemainingColumn

    columns: tuple[ProgressColumn, ...] = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[rate]}"),
        TextColumn("left:"),
        TimeRemainingColumn(elapsed_when_finished=True),
    )
    console = messages()
    with Progress(*columns, console=console, transient=True) as bar:
        console.show_cursor(True)  # who is killed meanwhile leaves the terminal as it was
        line = bar.add_task("runs", total=pace.total, completed=pace.done, rate="")

        def watch(outcome: Any) -> None:
            pace.add(outcome)
            bar.update(line, advance=1, rate=pace.words())

        yield watch


@contextmanager
def _lines(pace: Pace) -> Iterator[Watch]:
    """Print a plain line with the first run and the last, and every `EVERY` seconds between."""
    shown = -EVERY

    def watch(outcome: Any) -> None:
        nonlocal shown
        pace.add(outcome)
        now = time.perf_counter()
        if now - shown < EVERY and pace.done < pace.total:
            return
        shown = now
        left = (pace.total - pace.done) / pace.rate
        sys.stderr.write(f"{pace.done}/{pace.total} runs, {pace.words()}, about {left:.0f} s left\n")
        sys.stderr.flush()

    yield watch
