"""Durable queue of runs: DBOS keeps who is next; the table of runs says what became of each.

A run is a workflow whose id is the run's. Whatever dies in between, `recover` finds runs whose holder is gone and makes
their workflows eligible again, so that each is solved to its end once.
"""

import logging
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from dbos import DBOS, SetWorkflowID
from sqlalchemy.engine import Engine

from optiplan.service.execution.event_writer import AWAY, EventWriter, until_written
from optiplan.service.execution.leases import take_lease
from optiplan.service.execution.run_solver import failed
from optiplan.service.settings import ServiceSettings
from optiplan.service.store.run_table import Record, RunEnd, RunTable

QUEUE = "optiplan"
VERSION = "optiplan-1"
"""Of the workflow, not of the program: a newer program takes over the runs of an older one."""
POLLING = 0.05
"""s between two looks for the next run."""
LOOK = 0.2
"""s between two looks for runs to be cancelled."""
RECOVERY = 2.0
"""s between two looks for runs whose holder is gone."""
AT_ONCE = 500
"""Workflows looked up in one query."""
LOST_AFTER = 5.0
"""s after which a queued run has a workflow, else it is made again."""

PATIENCE = 3
"""s for each of: threads, runs under way, events to come to an end when the queue is closed."""

_log = logging.getLogger("optiplan.service")

Solve = Callable[[Record, threading.Event], RunEnd]
"""Solves a run, until the event is set, and says how it ended."""


class RunQueue:
    """The queue of one database, as one process sees it; there is one in a process."""

    def __init__(
        self, settings: ServiceSettings, engine: Engine, runs: RunTable, events: EventWriter, solve: Solve
    ) -> None:
        self._settings, self._engine, self._runs, self._events, self._solve = settings, engine, runs, events, solve
        self._lease = take_lease(engine, settings.data / "alive")
        self._active: dict[str, threading.Event] = {}
        self._activating = threading.Lock()
        self._stop = threading.Event()
        loops = {"watch": self._watch, "recover": self._keep_recovering}
        self._threads = [threading.Thread(target=loop, name=name, daemon=True) for name, loop in loops.items()]

    def start(self) -> None:
        """Begin to take runs, if this process solves any."""
        global _current
        _current = self
        logging.getLogger("dbos").setLevel(logging.ERROR)
        DBOS(
            config={
                "name": "optiplan",
                "system_database_url": self._settings.database_url,
                "system_database_engine": self._engine,  # whose errors end a try: its own would sleep on for minutes
                "executor_id": self._lease.name,
                "application_version": VERSION,
                "log_level": "ERROR",
                "notification_listener_polling_interval_sec": 1.0,
            }
        )
        if not self._settings.solvers:
            DBOS.listen_queues([])
        DBOS.launch()
        if self._settings.solvers:
            DBOS.register_queue(
                QUEUE,
                worker_concurrency=self._settings.solvers,
                polling_interval_sec=POLLING,
                on_conflict="always_update",
            )
        self._events.start()
        for thread in self._threads:
            thread.start()

    @property
    def ended(self) -> list[str]:
        """Names of the threads without which no run is taken, or none ends, that have ended."""
        found = [thread.name for thread in self._threads if not thread.is_alive()]
        found += [] if self._events.alive else ["events"]
        found += [] if self._lease.held else ["lease"]
        taker = f"queue-worker-{QUEUE}"  # as DBOS names it
        taken = not self._settings.solvers or any(thread.name == taker for thread in threading.enumerate())
        return found if taken else [*found, taker]

    def close(self) -> None:
        """Stop; runs under way are put back into the queue."""
        global _current
        self._stop.set()
        for cancel in list(self._active.values()):
            cancel.set()
        for thread in self._threads:
            if thread.is_alive():
                thread.join(PATIENCE)
        DBOS.destroy(workflow_completion_timeout_sec=PATIENCE)
        self._events.close(PATIENCE)
        _current = None
        self._lease.close()

    def enqueue(self, run: str) -> None:
        """Make sure that a queued run has a workflow that somebody will take; safe to do twice.

        While the database is away nothing is done: `recover` makes up for it.
        """
        try:
            self._enqueue(run)
        except AWAY as error:
            _log.warning("run %s is put into the queue later: %s", run, error)

    def _enqueue(self, run: str) -> None:
        status = DBOS.get_workflow_status(run)
        if status is not None and status.status in ("SUCCESS", "ERROR", "MAX_RECOVERY_ATTEMPTS_EXCEEDED"):
            DBOS.delete_workflow(run)  # of a former try
            status = None
        if status is None:
            with SetWorkflowID(run):
                DBOS.enqueue_workflow(QUEUE, _solve_run, run)
        elif status.status != "ENQUEUED" and not self._held(run, status.executor_id):
            DBOS.resume_workflow(run, queue_name=QUEUE)

    def cancel(self, run: str, submission: str | None = None, everyone: bool = False) -> int:
        """Cancel a run, wherever it is, if nobody else wants it; return for how many it goes on."""
        left = self._runs.cancel(run, submission, everyone)
        if not left and (event := self._active.get(run)) is not None:
            event.set()
        return left

    def forget(self, run: str) -> None:
        """Delete what the queue knows of a run."""
        with suppress(Exception):  # it may know nothing
            DBOS.delete_workflow(run)

    def recover(self, patience: float = LOST_AFTER) -> int:
        """Put back the runs whose holder is gone, and those that no workflow stands for; return how many."""
        count = 0
        for record in self._runs.of_states(["running"]):
            holder = record["holder"]
            gone = record["id"] not in self._active if holder == self._lease.name else not self._lease.alive(holder)
            if gone and self._runs.release(record["id"], holder):
                self.enqueue(record["id"])
                count += 1
        before = self._runs.now() - patience
        queued = [one["id"] for one in self._runs.of_states(["queued"]) if one["submitted"] <= before]
        for begin in range(0, len(queued), AT_ONCE):
            part = queued[begin : begin + AT_ONCE]
            found = DBOS.list_workflows(workflow_ids=part, status="ENQUEUED", load_input=False, load_output=False)
            for run in set(part) - {one.workflow_id for one in found} - set(self._active):
                self.enqueue(run)
        return count

    def work(self, run: str) -> None:
        """Solve a run that is queued; nothing is to be done for one that is not.

        What the database does not take is given to it again until it does, or this queue is closed: then the run is
        still held by this process, and another takes it once this one has ended.
        """
        with self._activating:
            if run in self._active:
                return
            cancel = self._active[run] = threading.Event()
        try:
            holder = self._lease.name
            record = until_written(lambda: self._runs.begin(run, holder), self._stop, f"beginning of run {run}")
            if record is None:
                return
            end = self._solved(record, cancel)
            self._events.settle(run, self._stop)
            if end.status == "cancelled" and self._stop.is_set():  # this process was cancelled, not the run
                self._runs.release(run, holder)
            else:
                self._record(run, end)
        finally:
            del self._active[run]

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
            until_written(lambda: self._runs.end(run, self._lease.name, end), self._stop, what)
        except AWAY:
            raise
        except Exception as error:
            _log.exception("%s cannot be recorded", what)
            refused = failed("bug", f"its end cannot be recorded: {type(error).__name__}")
            until_written(lambda: self._runs.end(run, self._lease.name, refused), self._stop, what)

    def _held(self, run: str, executor: str | None) -> bool:
        """Whether a workflow is in the hands of a process that lives and works on it."""
        if executor == self._lease.name:
            return run in self._active
        return bool(executor) and self._lease.alive(str(executor))

    def _watch(self) -> None:
        """Cancel runs under way that somebody, perhaps elsewhere, wants cancelled."""
        while not self._stop.wait(LOOK):
            if not self._active:
                continue
            try:
                for run in self._runs.to_be_cancelled(self._lease.name):
                    if (event := self._active.get(run)) is not None:
                        event.set()
            except Exception as error:  # the database may be away for a while
                _log.warning("runs to be cancelled cannot be looked up: %s", error)

    def _keep_recovering(self) -> None:
        patience = 0.0
        while True:
            try:
                count = self.recover(patience)
                patience = LOST_AFTER
                if count:
                    _log.info("runs of ended processes put back", extra={"runs": count})
            except Exception as error:
                _log.warning("runs of ended processes cannot be looked up: %s", error)
            if self._stop.wait(RECOVERY):
                return


_current: RunQueue | None = None


@DBOS.workflow(name="optiplan.solve")
def _solve_run(run: str) -> None:
    """Solve a run, by the queue of this process."""
    _work(run)


@DBOS.step(name="optiplan.work")
def _work(run: str) -> None:
    queue: Any = _current
    queue.work(run)
