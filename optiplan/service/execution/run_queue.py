"""Durable queue of runs: the table of runs says which are queued, and one of all processes wins each.

What is queued is in the table alone, so that nothing can be lost between it and a queue. Whatever dies in between,
`recover` puts back the runs whose holder is gone, so that each is solved to its end once.
"""

import logging
import threading
import time
from collections.abc import Callable
from dataclasses import field

from sqlalchemy.engine import Engine

from optiplan.records import dataclass
from optiplan.service.execution.event_writer import AWAY, EventWriter, until_written
from optiplan.service.execution.leases import take_lease
from optiplan.service.execution.run_solver import failed
from optiplan.service.settings import ServiceSettings
from optiplan.service.store.run_table import Record, RunEnd, RunTable

AWAKE, ASLEEP = 0.05, 0.5
"""s between two looks for the next run: just after one, and once there was none for some seconds.

Only runs that another process took in wait for a look; this one is woken for its own.
"""
DROWSE = 1.2
"""How much longer each wait for a look is than the one before."""
LOOK = 0.2
"""s between two looks for runs to be cancelled."""
RECOVERY = 2.0
"""s between two looks for runs whose holder is gone."""
RESPITE = 1.0
"""s before a thread that failed takes the next run."""
PATIENCE = 3
"""s for each of: threads with the runs under way, events to come to an end when the queue is closed."""

_log = logging.getLogger("optiplan.service")

Solve = Callable[[Record, threading.Event], RunEnd]
"""Solves a run, until the event is set, and says how it ended."""


@dataclass
class _InHand:
    """A run in the hands of this process.

    Attributes:
        cancel: set to end it.
        begun: the table says that it is ours.
    """

    cancel: threading.Event = field(default_factory=threading.Event)
    begun: bool = False


class RunQueue:
    """The queue of one database, as one process sees it."""

    def __init__(
        self, settings: ServiceSettings, engine: Engine, runs: RunTable, events: EventWriter, solve: Solve
    ) -> None:
        self._runs, self._events, self._solve = runs, events, solve
        self._lease = take_lease(engine, settings.data / "alive")
        self._active: dict[str, _InHand] = {}
        self._looking = threading.Lock()
        self._woken, self._stop = threading.Event(), threading.Event()
        loops = {"watch": self._watch, "recover": self._keep_recovering}
        loops |= {f"taker-{number}": self._keep_taking for number in range(settings.solvers)}
        self._threads = [threading.Thread(target=loop, name=name, daemon=True) for name, loop in loops.items()]

    def start(self) -> None:
        """Begin to take runs, if this process solves any."""
        self._events.start()
        for thread in self._threads:
            thread.start()

    @property
    def ended(self) -> list[str]:
        """Names of the threads without which no run is taken, or none ends, that have ended."""
        found = [thread.name for thread in self._threads if not thread.is_alive()]
        found += [] if self._events.alive else ["events"]
        return found if self._lease.held else [*found, "lease"]

    @property
    def holder(self) -> str:
        """The name by which the database knows what this process has in hand."""
        return self._lease.name

    def alive(self, holder: str | None) -> bool:
        """Whether the process of a holder lives."""
        return holder is not None and self._lease.alive(holder)

    def close(self) -> None:
        """Stop; runs under way are put back into the queue."""
        self._stop.set()
        self._woken.set()
        for one in list(self._active.values()):
            one.cancel.set()
        until = time.monotonic() + PATIENCE
        for thread in self._threads:
            if thread.is_alive():
                thread.join(max(0.0, until - time.monotonic()))
        self._events.close(PATIENCE)
        self._lease.close()

    def wake(self) -> None:
        """Have the next run looked for at once: there is one."""
        self._woken.set()

    def cancel(self, run: str, submission: str | None = None, everyone: bool = False) -> int:
        """Cancel a run, wherever it is, if nobody else wants it; return for how many it goes on."""
        left = self._runs.cancel(run, submission, everyone)
        if not left and (one := self._active.get(run)) is not None:
            one.cancel.set()
        return left

    def recover(self) -> int:
        """Put back the runs whose holder is gone; return how many."""
        count = 0
        for record in self._runs.of_states(["running"]):
            holder = record["holder"]
            gone = record["id"] not in self._active if holder == self._lease.name else not self._lease.alive(holder)
            count += gone and self._runs.release(record["id"], holder)
        if count:
            self.wake()
        return count

    def _keep_taking(self) -> None:
        while not self._stop.is_set():
            try:
                if (run := self._next()) is not None:
                    self._work(run)
            except AWAY as error:  # only once this queue is closed
                _log.warning("the database is away: %s", error)
            except Exception:  # a thread that ended would take no run any more
                _log.exception("a run could not be taken or ended")
                self._stop.wait(RESPITE)

    def _next(self) -> str | None:
        """The first queued run, from now on in the hands of the calling thread; None once this queue is closed."""
        with self._looking:  # one thread looks for all
            wait = AWAKE
            while True:
                self._woken.clear()
                if self._stop.is_set():
                    return None
                run = until_written(lambda: self._runs.first_queued(list(self._active)), self._stop, "the next run")
                if run is not None:
                    self._active[run] = _InHand()
                    return run
                wait = AWAKE if self._woken.wait(wait) else min(ASLEEP, DROWSE * wait)

    def _work(self, run: str) -> None:
        """Solve a run in hand, if this process is the first to begin it.

        What the database does not take is given to it again until it does, or this queue is closed: then the run is
        still held by this process, and another takes it once this one has ended.
        """
        holder, mine = self._lease.name, self._active[run]
        if self._stop.is_set():  # set before those in hand were cancelled, or while this one was taken
            mine.cancel.set()
        try:
            record = until_written(lambda: self._runs.begin(run, holder), self._stop, f"beginning of run {run}")
            if record is None:
                return
            mine.begun = True
            end = self._solved(record, mine.cancel)
            self._events.settle(run, self._stop)
            if end.status == "cancelled" and self._stop.is_set():  # this process was cancelled, not the run
                self._runs.release(run, holder)
            else:
                self._record(run, end)
        finally:
            del self._active[run]
            self.wake()  # it may have been submitted anew while it was in hand

    def _solved(self, record: Record, cancel: threading.Event) -> RunEnd:
        """How a run ended; an exception is an end."""
        try:
            return self._solve(record, cancel)
        except Exception as error:
            _log.exception("run %s failed", record["id"])
            return failed("bug", f"internal error: {type(error).__name__}: {error}")

    def _record(self, run: str, end: RunEnd) -> None:
        """Record an end; one that the database refuses for good is recorded as a failure."""
        what = f"end of run {run}"
        try:
            if not until_written(lambda: self._runs.end(run, self._lease.name, end), self._stop, what):
                _log.warning("%s is nobody's: it was submitted anew, or taken from this process", what)
        except AWAY:
            raise
        except Exception as error:
            _log.exception("%s cannot be recorded", what)
            refused = failed("bug", f"its end cannot be recorded: {type(error).__name__}")
            until_written(lambda: self._runs.end(run, self._lease.name, refused), self._stop, what)

    def _watch(self) -> None:
        """Cancel runs under way that somebody, perhaps elsewhere, wants cancelled, or that are no longer ours.

        One that was cancelled elsewhere may have been submitted anew before this process looked: it is queued then.
        """
        while not self._stop.wait(LOOK):
            begun = {run: one.cancel for run, one in list(self._active.items()) if one.begun}
            if not begun:  # looked up before the table is: what begins after that is ours, too
                continue
            try:
                wanted = self._runs.wanted(self._lease.name)
                for run in begun.keys() - wanted:
                    begun[run].set()
            except Exception as error:  # the database may be away for a while
                _log.warning("runs to be cancelled cannot be looked up: %s", error)

    def _keep_recovering(self) -> None:
        while True:
            try:
                if count := self.recover():
                    _log.info("runs of ended processes put back", extra={"runs": count})
            except Exception as error:
                _log.warning("runs of ended processes cannot be looked up: %s", error)
            if self._stop.wait(RECOVERY):
                return
