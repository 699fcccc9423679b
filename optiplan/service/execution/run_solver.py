"""How a run is solved: its request read from the contents, planned under hard limits, its files kept."""

import json
import threading
import time
from typing import Any

from optiplan.service.execution.event_writer import EventWriter
from optiplan.service.execution.solver_pool import SolverAnswer, SolverJob, SolverPool
from optiplan.service.settings import ServiceSettings
from optiplan.service.store.contents import ContentFolder, StorageFullError
from optiplan.service.store.run_table import Record, RunEnd

GRACE = 5.0
"""s beyond its budget that a planner is given to come to an end."""
LEAD = 0.1
"""s before its deadline at which a planner has to be done."""
STAGE = 0.5
"""s between two events about one stage."""


def failed(kind: str, detail: str) -> RunEnd:
    """The end of a run without a motion."""
    return RunEnd("failed", False, failure={"kind": kind, "detail": detail, "witness": {}})


class RunSolver:
    """Solves queued runs; one for all threads of a process."""

    def __init__(
        self, settings: ServiceSettings, events: EventWriter, contents: ContentFolder, pool: SolverPool
    ) -> None:
        self._settings, self._events, self._contents, self._pool = settings, events, contents, pool

    def __call__(self, record: Record, cancel: threading.Event) -> RunEnd:
        """Solve a run that has just begun, until the event is set.

        Its deadline is of durations alone: from submission to beginning by the database's clock, from there by ours.
        """
        stored = self._contents.get(record["request"])
        if stored is None:
            return failed("storage", "the problem of this run is not in the folder of contents (--data)")
        waited = record["started"] - record["submitted"]
        left = float("inf") if record["deadline"] is None else record["deadline"] - waited
        if left <= LEAD:
            return failed("deadline", f"the deadline of {record['deadline']:g} s passed before the run began")
        request = {**json.loads(stored), "do": "plan", "hash": record["problem"]}
        request["budget"] = min(record["budget"], left - LEAD)
        job = SolverJob(
            request,
            wall=self._settings.reading + record["budget"] + GRACE,
            until=time.monotonic() + left,
            told=_Teller(self._events, record["id"]),
            cancel=cancel,
        )
        return self.ended(self._pool.submit("queue", job).result(), left < record["budget"])

    def ended(self, answer: SolverAnswer, late: bool = False) -> RunEnd:
        """How a run ended, with its files kept; `late` where only the deadline can have stopped it."""
        if answer.death == "cancelled":
            return RunEnd("cancelled")
        if answer.death is not None:
            return failed("deadline" if late and answer.death == "timeout" else answer.death, answer.detail)
        data = answer.data
        if "error" in data:
            return failed("bug" if "bug" in data else "out-of-memory" if "memory" in data else "input", data["error"])
        try:
            contents = {name: self._contents.put(content) for name, content in answer.files.items()}
        except (StorageFullError, OSError) as error:
            return failed("storage", str(error))
        return RunEnd(
            status="failed" if data["failure"] else "done",
            verified=data.get("verified", False),
            duration=data.get("duration"),
            ratio=data.get("ratio"),
            failure=data["failure"],
            timings=data["timings"],
            contents=contents,
            bytes=sum(map(len, answer.files.values())),
        )


class _Teller:
    """Turns messages of a process into events of a run."""

    def __init__(self, events: EventWriter, run: str) -> None:
        self._events, self._run = events, run
        self._stage, self._told = "", 0.0

    def __call__(self, message: Any) -> None:
        now = time.monotonic()
        if message["phase"] == "best":
            event = {"type": "best", "seconds": message["seconds"], "duration": message["duration"]}
        elif message["stage"] != self._stage or now - self._told >= STAGE:
            self._stage, self._told = message["stage"], now
            event = {"type": "stage", "stage": message["stage"], "fraction": message["fraction"]}
        else:
            return
        self._events.report(self._run, event)
