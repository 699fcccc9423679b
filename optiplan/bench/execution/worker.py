"""Process of a slot: takes tasks from a pipe one by one and sends back their outcomes.

Its arguments are the folders of Python modules (JSON), one end of a pair of sockets, the process that must live for
this one to live, and the core to stay on (-1: any). Standard output and standard error belong to the planners: what
they print is recorded with the run. Above it stands its keeper (`keeper.py`), which ends and reaps what planners start.
"""

import ctypes
import json
import os
import resource
import sys
from contextlib import suppress
from multiprocessing.connection import Connection

from optiplan.bench.execution.keeper import keep_a_child


def main() -> None:
    """Serve until the other end is closed, in a child of the keeper that this process becomes."""
    socket, parent, core = (int(word) for word in sys.argv[2:5])
    if core >= 0:
        os.sched_setaffinity(0, {core})
    keep_a_child(parent, socket)
    connection = Connection(socket)
    from optiplan.bench.execution.run_task import TaskExecutor  # takes half a second: after the line above

    libc, execute, ours = ctypes.CDLL(None), TaskExecutor(), os.getpid()
    from optiplan.bench.results.records import BenchTask

    def send(message: dict[str, object]) -> None:
        if os.getpid() != ours:  # a planner forked and both processes returned: only the original one answers
            os._exit(0)
        for stream in (sys.stdout, sys.stderr):
            with suppress(Exception):  # a planner may have closed it
                stream.flush()
        libc.fflush(None)  # what C++ printed belongs to this run, not to the next
        connection.send_bytes(json.dumps(message, allow_nan=False).encode())

    send({"phase": "ready", "pid": ours})
    while True:
        try:
            task = BenchTask.from_dict(json.loads(connection.recv_bytes()))
        except EOFError:
            return
        limit_memory(task.memory)
        before = surroundings()
        outcome = execute(task, lambda name: send({"phase": name}))
        done = {"phase": "done", "row": vars(outcome.row), "blob": outcome.trajectory is not None}
        send(done | {"spoilt": surroundings() != before})
        if outcome.trajectory is not None:
            connection.send_bytes(outcome.trajectory)


def surroundings() -> list[object]:
    """Return what a planner must leave unchanged: files behind standard output and error, the working folder."""
    found: list[object] = [sys.stdout.closed, sys.stderr.closed]
    for ask in (lambda: os.fstat(1).st_ino, lambda: os.fstat(2).st_ino, os.getcwd):
        try:
            found.append(ask())
        except OSError:
            found.append(None)
    return found


def limit_memory(megabytes: float) -> None:
    """Refuse allocations beyond twice the limit at once: the watch over resident memory looks only now and then."""
    hard = resource.getrlimit(resource.RLIMIT_DATA)[1]
    wanted = int(2e6 * megabytes)
    resource.setrlimit(resource.RLIMIT_DATA, (wanted if hard < 0 else min(wanted, hard), hard))
