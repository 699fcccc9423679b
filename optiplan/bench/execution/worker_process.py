"""Process of a slot, seen from its parent: started under a keeper, spoken to over a pipe, ended with all it started."""

import json
import os
import select
import signal
import socket
import subprocess
import sys
from collections.abc import Mapping
from multiprocessing.connection import Connection, wait
from typing import Any, Literal

from optiplan.bench.execution import machine
from optiplan.records import dataclass

DeathKind = Literal["crashed", "out-of-memory", "timeout"]

LAST = 10.0
"""s that a keeper has to end and reap what its worker started."""
OUTPUT = 8000
"""Bytes of what a run prints that are kept, the last ones."""
CHUNKS = 64
"""Reads of at most 64 KiB at a time."""
BOOT = "import json, sys; sys.path[:] = json.loads(sys.argv[1]); from {} import main; main()"
"""Makes a worker look for modules where we do, without a word to the programs that planners start."""
FROM_OUTSIDE = (signal.SIGKILL, signal.SIGTERM)
"""Signals that no planner sends itself: a run that ends by them is made once more."""


@dataclass(frozen=True)
class Death:
    """Why a worker ended, in a run's phase: the kind of failure and the rest of the sentence."""

    kind: DeathKind
    detail: str
    signal: int | None = None
    how: str = ""


class WorkerProcess:
    """The process, its keeper, and the two ways that lead to it: messages, and what it prints.

    `pid` is 0 until the worker is ready; our own child is the keeper, which ends as the worker does.
    """

    def __init__(self, module: str, core: int | None = None) -> None:
        """Start it.

        Args:
            module: whose `main` it runs, with the arguments that `worker.main` takes.
            core: to stay on; None: any.
        """
        ours, theirs = socket.socketpair()
        words = (theirs.fileno(), os.getpid(), -1 if core is None else core)
        command = [sys.executable, "-c", BOOT.format(module), json.dumps(sys.path), *map(str, words)]
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

    def begin(self, task: Mapping[str, Any]) -> None:
        """Send a task, JSON-ready; discard earlier output."""
        self._drain()
        self._tail = b""
        self._send(task)

    def hears(self) -> bool:
        """Return whether words can be sent: the line of a process that reads none gets full, and we would wait."""
        line = select.poll()
        line.register(self._connection.fileno(), select.POLLOUT)
        return bool(line.poll(0))

    def say(self, words: Mapping[str, Any]) -> None:
        """Send words, JSON-ready, to a task that listens while it runs, as `said`: it may have ended by now."""
        self._send({"said": words})

    def _send(self, message: Mapping[str, Any]) -> None:
        try:
            self._connection.send_bytes(json.dumps(message, allow_nan=False).encode())
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
                    message["content"] = self._connection.recv_bytes()
                return message
        except (EOFError, OSError):
            self.gone = True
        self.gone = self.gone or self._process.poll() is not None
        return None

    def exit_seen(self) -> bool:
        """Return whether the process has ended, perhaps while nobody waited for a message."""
        self.gone = self.gone or self._process.poll() is not None
        return self.gone

    def autopsy(self) -> Death:
        """Return how a dead process ended."""
        try:
            code = self._process.wait(5.0)
        except subprocess.TimeoutExpired:
            return Death("crashed", "the process closed its pipe and lives on", how="pipe closed")
        if b"std::bad_alloc" in self._rest() or b"MemoryError" in self._tail:
            return Death("out-of-memory", "an allocation was refused")
        if code < 0:
            return Death("crashed", signal.strsignal(-code) or "unknown signal", -code, f"signal {-code}")
        return Death("crashed", "the process ended", how=f"exit {code}")

    def output(self) -> str:
        """Return the end of the output since the task began."""
        return self._rest().decode(errors="replace")

    def kill(self) -> None:
        """End the worker and its descendants, also in other sessions; return when all are reaped.

        One with a respite ends by itself first, as its line is closed.
        """
        self.gone = True
        self._connection.close()
        self._process.terminate()  # the keeper ends the others
        try:
            self._process.wait(LAST)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._rest()
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
