"""Progress line of long commands."""

import logging
import signal
import sys
import threading
import time
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from optiplan.trajectory.trajectory import Trajectory

QUIET = 2.0
"""Seconds before anything is shown: short work needs no running commentary."""
EVERY = 0.1
"""Seconds between two changes of the line."""
SILENT = 1.0
"""Seconds without a report after which the line goes on by itself."""


class ProgressLog(logging.Handler):
    """Print a line on stderr for each stage of long work, and for what the program logs on the way; a context manager.

    In a file or a pipe as in a terminal: what takes a minute should say what it does.
    """

    def __init__(self) -> None:
        super().__init__(logging.INFO)
        self._began, self._last = time.perf_counter(), ""
        self._logger = logging.getLogger("optiplan")
        self._level = self._logger.level

    def __call__(self, stage: str, fraction: float) -> None:
        """Print the stage, unless it is the last one again."""
        if stage != self._last:
            self._last = stage
            sys.stderr.write(f"{time.perf_counter() - self._began:6.1f} s  {stage}\n")
            sys.stderr.flush()

    def emit(self, record: logging.LogRecord) -> None:
        """Print what is logged."""
        self(record.getMessage(), 0.0)

    def __enter__(self) -> "ProgressLog":
        self._logger.addHandler(self)
        self._logger.setLevel(min(self._level or logging.INFO, logging.INFO))
        return self

    def __exit__(self, *error: object) -> None:
        """Listen no more."""
        self._logger.removeHandler(self)
        self._logger.setLevel(self._level)


class ProgressLine:
    """Show the stage, the elapsed seconds and the best motion on stderr, only in a terminal; use as a context manager.

    The line is plain text: a killed process leaves no hidden cursor.
    """

    def __init__(self) -> None:
        self._began = self._shown = time.perf_counter()
        self._visible = False
        self._wanted = sys.stderr.isatty()
        self._stage, self._fraction, self._best = "", 0.0, ""
        self._ended = threading.Event()
        self._ticker = threading.Thread(target=self._tick, name="progress", daemon=True)

    def __call__(self, stage: str, fraction: float) -> None:
        """Report the stage and its fraction done (0 to 1); cheap enough for an inner loop."""
        self._stage, self._fraction = stage, fraction
        now = time.perf_counter()
        if not self._wanted or now - self._began < QUIET or now - self._shown < EVERY:
            return
        self._shown, self._visible = now, True
        done = f" {fraction:4.0%}" if fraction > 0.0 else ""
        sys.stderr.write(f"\r\x1b[K{now - self._began:5.1f} s  {stage}{done}{self._best}")
        sys.stderr.flush()

    def found(self, trajectory: "Trajectory", bound: float) -> None:
        """Keep when a better motion was found, its duration and how far that is from the lower bound, s, for the line.

        A bound of 0 is none.
        """
        gap = f", {trajectory.duration / bound - 1.0:.1%} above the bound" if bound > 0.0 else ""
        seconds = time.perf_counter() - self._began
        self._best = f"  best {trajectory.duration:.3f} s (found after {seconds:.2f} s{gap})"

    def _tick(self) -> None:
        """Go on with the seconds of a stage that does not report."""
        while not self._ended.wait(SILENT):
            if self._stage and time.perf_counter() - self._shown > SILENT:
                self(self._stage, self._fraction)

    def __enter__(self) -> "ProgressLine":
        if self._wanted:
            self._ticker.start()
        return self

    def __exit__(self, *error: object) -> None:
        """Wipe the line."""
        if self._wanted:
            self._ended.set()
            self._ticker.join()
        if self._visible:
            sys.stderr.write("\r\x1b[K")
            sys.stderr.flush()


class KeptAnswer(ProgressLine):
    """The line of a run whose first Ctrl-C keeps the motion, once there is one; before, it ends the process as ever.

    The second Ctrl-C ends the process at once.

    Attributes:
        cancel: of the run's `Budget`; set by the first Ctrl-C.
    """

    def __init__(self) -> None:
        super().__init__()
        self.cancel = threading.Event()
        self._before: Any = None

    def found(self, trajectory: "Trajectory", bound: float) -> None:
        """Take Ctrl-C from now on, besides what a line does."""
        super().found(trajectory, bound)
        if self._before is None:
            self._before = signal.signal(signal.SIGINT, self._keep)

    def _keep(self, *_: object) -> None:
        self.cancel.set()
        signal.signal(signal.SIGINT, signal.SIG_DFL)

    def __exit__(self, *error: object) -> None:
        """Wipe the line, and leave Ctrl-C as it was."""
        if self._before is not None:
            signal.signal(signal.SIGINT, self._before)
        super().__exit__(*error)
