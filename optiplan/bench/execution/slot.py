"""Slot: one run at a time, in a process of its own under hard limits; every end of it is an outcome."""

import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection, wait
from typing import Any

from optiplan.bench.execution import machine
from optiplan.bench.results.records import BenchTask, Outcome, Row, RunFailureKind, empty_row, failure
from optiplan.errors import OptiPlanError

POLL = 0.05
"""s between two looks at the clock and at the worker's memory."""
START = 300.0
"""s within which a new worker has to be ready: imports only, but maybe of a hundred workers at once."""
LAST = 10.0
"""s that a keeper has to end and reap what its worker started."""
OUTPUT = 8000
"""Bytes of what a run prints that are kept, the last ones."""
CHUNKS = 64
"""Reads of at most 64 KiB at a time."""
BOOT = (
    "import json, sys; sys.path[:] = json.loads(sys.argv[1]); from optiplan.bench.execution.worker import main; main()"
)
"""Makes a worker look for modules where we do, without a word to the programs that planners start."""
FROM_OUTSIDE = (signal.SIGKILL, signal.SIGTERM)
"""Signals that no planner sends itself: a run that ends by them is made once more."""


class WorkerError(OptiPlanError):
    """A worker that cannot start."""


class Stopped(Exception):
    """Stop requested; the current run is given up and not recorded."""


@dataclass(frozen=True)
class _Death:
    """Why a worker ended, in a run's phase: the kind of failure and the rest of the sentence."""

    kind: RunFailureKind
    detail: str
    signal: int | None = None
    how: str = ""


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
        self._worker: _Worker | None = None

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

    def _attempt(self, task: BenchTask) -> tuple[Outcome, _Death | None]:
        worker = self._ready()
        began, started, phase, peak = time.perf_counter(), machine.now(), "load", 0.0
        worker.begin(task)
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
                return Outcome(replace(row, output=worker.output(), memory=peak), message.get("trajectory")), None
            if message is not None:
                phase, deadline = message["phase"], time.perf_counter() + task.wall
            death = self._death(worker, task, (phase, deadline, peak))
            if death is not None:
                self.close()
                columns = empty_row(task) | failure(death.kind, f"{death.detail} (phase: {phase})", how=death.how)
                columns |= {"wall_time": time.perf_counter() - began, "memory": peak, "load": machine.load()}
                return Outcome(Row(**columns, output=worker.output(), started_at=started)), death

    def _death(self, worker: "_Worker", task: BenchTask, state: tuple[str, float, float]) -> _Death | None:
        """Why the worker has ended or has to end; None when all is well."""
        _, deadline, peak = state
        if worker.gone:
            return worker.autopsy()
        if peak > task.memory:
            return _Death("out-of-memory", f"{peak:.0f} MB resident; the limit is {task.memory:.0f} MB")
        if time.perf_counter() > deadline:
            return _Death("timeout", f"no answer within the hard limit of {task.wall:g} s")
        return None

    def _ready(self) -> "_Worker":
        if self._worker is not None and not self._worker.gone:
            return self._worker
        self.close()
        began = time.perf_counter()
        self._worker = worker = _Worker(self._core)
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


class _Worker:
    """The process, its keeper, and the two ways that lead to it: messages, and what it prints.

    `pid` is 0 until the worker is ready; our own child is the keeper, which ends as the worker does.
    """

    def __init__(self, core: int | None) -> None:
        ours, theirs = socket.socketpair()
        words = (theirs.fileno(), os.getpid(), -1 if core is None else core)
        command = [sys.executable, "-c", BOOT, json.dumps(sys.path), *map(str, words)]
        with theirs:
            self._process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                env={**os.environ, "OMP_NUM_THREADS": "1"},
                pass_fds=(theirs.fileno(),),
                start_new_session=True,  # Ctrl-C is for the runner; and what a planner starts is ended with it
            )
        self.pid = 0
        self._connection = Connection(ours.detach())
        assert self._process.stdout is not None
        self._printed = self._process.stdout.fileno()
        os.set_blocking(self._printed, False)
        self._tail = b""
        self._silent = False  # it closed its standard output
        self.gone = False

    def greet(self, patience: float) -> None:
        """Read the worker's `pid` from its first message, if that arrives within this time, s."""
        message = self.message(patience)
        self.pid = 0 if message is None else message["pid"]

    def processes(self) -> list[int]:
        """Return the worker, first, and its descendants that have not been reaped."""
        others = [pid for pid in machine.descendants(self._process.pid) if pid != self.pid]
        return [self.pid, *others]

    def begin(self, task: BenchTask) -> None:
        """Send a task; discard earlier output."""
        self._drain()
        self._tail = b""
        try:
            self._connection.send_bytes(json.dumps(task.to_dict(), allow_nan=False).encode())
        except OSError:
            self.gone = True

    def message(self, patience: float) -> dict[str, Any] | None:
        """Return the next message if it arrives within this time, s; set `gone` when the worker has ended."""
        if self.gone:
            return None
        ready = wait([self._connection] if self._silent else [self._connection, self._printed], patience)
        if self._printed in ready:
            self._drain()
        try:
            if self._connection in ready:
                message: dict[str, Any] = json.loads(self._connection.recv_bytes())
                if message.get("blob"):
                    message["trajectory"] = self._connection.recv_bytes()
                return message
        except (EOFError, OSError):
            self.gone = True
        self.gone = self.gone or self._process.poll() is not None
        return None

    def autopsy(self) -> _Death:
        """Return how a dead process ended."""
        try:
            code = self._process.wait(5.0)
        except subprocess.TimeoutExpired:
            return _Death("crashed", "the process closed its pipe and lives on", how="pipe closed")
        if b"std::bad_alloc" in self._rest() or b"MemoryError" in self._tail:
            return _Death("out-of-memory", "an allocation was refused")
        if code < 0:
            return _Death("crashed", signal.strsignal(-code) or "unknown signal", -code, f"signal {-code}")
        return _Death("crashed", "the process ended", how=f"exit {code}")

    def output(self) -> str:
        """Return the end of the output since the task began."""
        return self._rest().decode(errors="replace")

    def kill(self) -> None:
        """End the worker and its descendants, also in other sessions; return when all are reaped."""
        self.gone = True
        self._process.terminate()  # the keeper ends the others
        try:
            self._process.wait(LAST)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._rest()
        self._connection.close()
        if self._process.stdout is not None:
            self._process.stdout.close()

    def _rest(self) -> bytes:
        if self._process.stdout is not None and not self._process.stdout.closed:
            self._drain()
        return self._tail

    def _drain(self) -> None:
        """Read the available output, up to a limit: a worker may print faster than it is read."""
        for _ in range(CHUNKS):
            try:
                read = os.read(self._printed, 65536)
            except BlockingIOError:
                return
            if not read:
                self._silent = True
                return
            self._tail = (self._tail + read)[-OUTPUT:]
