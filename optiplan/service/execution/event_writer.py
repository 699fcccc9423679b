"""Events of runs, written by a thread of their own: who reports one does not wait for the database or fail with it."""

import logging
import threading
from collections import deque
from collections.abc import Callable
from functools import partial
from typing import TypeVar

import sqlalchemy as sa

from optiplan.service.store.run_table import Record, RunTable
from optiplan.service.store.tables import DatabaseAwayError

Result = TypeVar("Result")

AWAY = (DatabaseAwayError, sa.exc.TimeoutError)
"""Errors after which a change is tried again."""
RETRY = 0.5
"""s between two tries to write while the database is away."""
MOST = 10_000
"""Events that may wait; stages beyond that are forgotten."""
AT_ONCE = 500
"""Events in one transaction."""

_log = logging.getLogger("optiplan.service")


def until_written(change: Callable[[], Result], stop: threading.Event, what: str) -> Result:
    """Return what a change of the database gives, tried until the database takes it.

    Raises:
        DatabaseAwayError: it had not when `stop` was set.
    """
    told = False
    while True:
        try:
            return change()
        except AWAY as error:
            if not told:
                _log.warning("%s: not yet: %s", what, error)
            told = True
            if stop.wait(RETRY):
                raise


class EventWriter:
    """Keeps events until the database has them; those of one run are written in the order of their reports."""

    def __init__(self, runs: RunTable) -> None:
        self._runs = runs
        self._waiting: deque[tuple[str, Record]] = deque()
        self._changed = threading.Condition()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._keep_writing, name="events", daemon=True)

    def start(self) -> None:
        """Begin to write."""
        self._thread.start()

    @property
    def alive(self) -> bool:
        """Whether its thread lives."""
        return self._thread.is_alive()

    def report(self, run: str, event: Record) -> None:
        """Have an event written, soon."""
        with self._changed:
            if len(self._waiting) < MOST or event["type"] != "stage":
                self._waiting.append((run, event))
                self._changed.notify_all()

    def settle(self, run: str, stop: threading.Event) -> None:
        """Wait until all events of a run are written, or `stop` is set."""
        with self._changed:
            while any(one == run for one, _ in self._waiting) and not stop.is_set() and self.alive:
                self._changed.wait(RETRY)

    def close(self, patience: float) -> None:
        """End it, once it has tried for so long, s, to write what waits."""
        self._stop.set()
        with self._changed:
            self._changed.notify_all()
        if self.alive:
            self._thread.join(patience)

    def _keep_writing(self) -> None:
        at_once = AT_ONCE
        while True:
            with self._changed:
                while not self._waiting and not self._stop.is_set():
                    self._changed.wait()
                part = [self._waiting[k] for k in range(min(at_once, len(self._waiting)))]
            if not part:
                return
            try:
                until_written(partial(self._runs.tell, part), self._stop, "events")
            except AWAY as error:
                _log.error("%d events are lost: %s", len(self._waiting), error)
                return
            except Exception:
                if at_once > 1:  # which of them is it?
                    at_once = 1
                    continue
                _log.exception("an event cannot be written: %s", part[0])
            else:
                at_once = AT_ONCE
            with self._changed:
                for _ in part:
                    self._waiting.popleft()
                self._changed.notify_all()
