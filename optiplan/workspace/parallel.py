"""Work in chunks on all cores: results in the order of the chunks, whatever the number of processes.

Not by `ProcessPoolExecutor`: that of Python 3.11 may not notice the death of the process that it started last, and its
processes stay behind if their parent is killed.
"""

import signal
from collections.abc import Callable
from contextlib import suppress
from multiprocessing.connection import Connection, wait
from typing import Generic, TypeVar

from optiplan.cores import WHY_DEAD, OneThreadContext
from optiplan.errors import OptiPlanError

R = TypeVar("R")

_DEAD = f"a worker process ended before its work was done: {WHY_DEAD}"


class ChunkedWork(Generic[R]):
    """Work in chunks: `prepare` runs once a process and returns the function that does chunk k."""

    def prepare(self) -> Callable[[int], R]:
        """The function from a chunk's number to its result; both this object and the result are pickled."""
        raise NotImplementedError


def run_chunks(
    work: ChunkedWork[R], count: int, processes: int, progress: Callable[[float], None] = lambda _: None
) -> list[R]:
    """Results of chunks 0 … count - 1; `progress` is told the fraction done.

    A process is given the next chunk when it has sent its last result, through a pipe of its own: a worker whose parent
    has died finds the pipe broken and ends, so none is left behind.

    Raises:
        OptiPlanError: a worker died, or the work raises one.
    """
    if processes <= 1 or count <= 1:
        do = work.prepare()
        done: list[R] = []
        for k in range(count):
            done.append(do(k))
            progress((k + 1) / count)
        return done
    context = OneThreadContext()
    connections: list[Connection] = []
    workers = []
    for _ in range(min(processes, count)):
        own, other = context.Pipe()
        worker = context.Process(target=_serve, args=(other,), daemon=True)
        worker.start()
        other.close()
        connections.append(own)
        workers.append(worker)
    try:
        results: dict[int, R] = _collect(work, connections, count, progress)
    finally:
        for worker in workers:
            worker.terminate()
            worker.join()
    return [results[k] for k in range(count)]


def _collect(
    work: ChunkedWork[R], connections: list[Connection], count: int, progress: Callable[[float], None]
) -> dict[int, R]:
    """Results of all chunks. The work goes through these pipes: writing the arguments of a dead process has no end."""
    results: dict[int, R] = {}
    rest = iter(range(count))
    try:
        for own in connections:
            own.send((work, next(rest)))
    except ConnectionError:
        raise OptiPlanError(_DEAD) from None
    while len(results) < count:
        for connection in wait(connections):
            assert isinstance(connection, Connection)
            try:
                found = connection.recv()
                if isinstance(found, OptiPlanError):
                    raise found
                k, result = found
                following = next(rest, None)
                if following is not None:
                    connection.send(following)
            except (EOFError, ConnectionError):
                raise OptiPlanError(_DEAD) from None
            if following is None:
                connections.remove(connection)
                connection.close()
            results[k] = result
            progress(len(results) / count)
    return results


def _serve(connection: Connection) -> None:
    """Do the chunks that the parent names, after the work itself, until it closes the pipe.

    Ctrl-C in a terminal is for the parent: this process ends with it, and has nothing to say.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with suppress(EOFError, ConnectionError):
        try:
            work, k = connection.recv()
            do = work.prepare()
            while True:
                connection.send((k, do(k)))
                k = connection.recv()
        except OptiPlanError as error:
            connection.send(error)
