"""Slot: one run at a time, in a process of its own under hard limits; every end of it is an outcome."""

import threading
import time
from dataclasses import replace

from optiplan.bench.execution import machine
from optiplan.bench.execution.worker_process import FROM_OUTSIDE, Death, WorkerProcess
from optiplan.bench.results.records import BenchTask, Outcome, Row, empty_row, failure
from optiplan.errors import OptiPlanError

POLL = 0.05
"""s between two looks at the clock and at the worker's memory."""
START = 300.0
"""s within which a new worker has to be ready: imports only, but maybe of a hundred workers at once."""
MODULE = "optiplan.bench.execution.worker"
"""What the process runs."""


class WorkerError(OptiPlanError):
    """A worker that cannot start."""


class Stopped(Exception):
    """Stop requested; the current run is given up and not recorded."""


class WorkerSlot:
    """Blocking: `run` returns when the task is done. A worker is started when needed and serves many tasks.

    To be used by one thread from beginning to end: workers die with the thread that started them.
    """

    def __init__(self, name: str, stop: threading.Event | None = None, core: int | None = None) -> None:
        """Give it a name, for column `worker`, an event that makes `run` raise `Stopped`, and a core to stay on."""
        self.name = name
        self._core = core
        self.starting = 0.0
        self._stop = stop or threading.Event()
        self._worker: WorkerProcess | None = None

    def run(self, task: BenchTask) -> Outcome:
        """Carry out a task.

        Raises:
            WorkerError: no worker can be started.
            Stopped: the event was set.
        """
        outcome, death = self._attempt(task)
        if death is not None and death.signal in FROM_OUTSIDE:
            outcome, death = self._attempt(task)
        return Outcome(replace(outcome.row, worker=self.name), outcome.trajectory)

    def close(self) -> None:
        """End the worker, whatever it is doing."""
        if self._worker is not None:
            self._worker.kill()
            self._worker = None

    def _attempt(self, task: BenchTask) -> tuple[Outcome, Death | None]:
        worker = self._ready()
        began, started, phase, peak = time.perf_counter(), machine.now(), "load", 0.0
        worker.begin(task.to_dict())
        deadline = began + task.wall
        while True:
            if self._stop.is_set():
                self.close()
                raise Stopped
            message = worker.message(POLL)
            peak = max(peak, machine.resident(worker.processes()))
            if message is not None and message["phase"] == "done":
                row = Row(**message["row"])
                if message["spoilt"] or len(worker.processes()) > 1:  # it must not disturb the next run
                    self.close()
                return Outcome(replace(row, output=worker.output(), memory=peak), message.get("content")), None
            if message is not None:
                phase, deadline = message["phase"], time.perf_counter() + task.wall
            death = self._death(worker, task, deadline, peak)
            if death is not None:
                self.close()
                columns = empty_row(task) | failure(death.kind, f"{death.detail} (phase: {phase})", how=death.how)
                columns |= {"wall_time": time.perf_counter() - began, "memory": peak, "load": machine.load_average()}
                return Outcome(Row(**columns, output=worker.output(), started_at=started)), death

    def _death(self, worker: WorkerProcess, task: BenchTask, deadline: float, peak: float) -> Death | None:
        """Why the worker has ended or has to end; None when all is well."""
        if worker.gone:
            return worker.autopsy()
        if peak > task.memory:
            return Death("out-of-memory", f"{peak:.0f} MB resident; the limit is {task.memory:.0f} MB")
        if time.perf_counter() > deadline:
            return Death("timeout", f"no answer within the hard limit of {task.wall:g} s")
        return None

    def _ready(self) -> WorkerProcess:
        if self._worker is not None and not self._worker.gone:
            return self._worker
        self.close()
        began = time.perf_counter()
        self._worker = worker = WorkerProcess(MODULE, self._core)
        while not worker.pid:
            worker.greet(POLL)
            if self._stop.is_set():
                self.close()
                raise Stopped
            if worker.gone or time.perf_counter() - began > START:
                self.close()
                raise WorkerError(f"a worker process does not start: {worker.output() or 'it says nothing'}")
        self.starting += time.perf_counter() - began
        return worker
