"""Work in chunks on all cores: results in the order of the chunks, whatever the number of processes."""

import multiprocessing
from collections.abc import Callable
from multiprocessing.connection import Connection, wait
from typing import Generic, TypeVar

from optiplan.errors import OptiPlanError

R = TypeVar("R")


class ChunkedWork(Generic[R]):
    """Work in chunks: `prepare` runs once a process and returns the function that does chunk k."""

    def prepare(self) -> Callable[[int], R]:
        """The function from a chunk's number to its result; both this object and the result are pickled."""
        raise NotImplementedError


def run_chunks(
    work: ChunkedWork[R], count: int, processes: int, progress: Callable[[float], None] = lambda _: None
) -> list[R]:
    """Results of chunks 0 … count - 1; `progress` is told the fraction done.

    Process p does chunks p, p + processes, … and sends each through its own pipe: a worker whose parent has died finds
    the pipe broken and ends, so none is left behind.

    Raises:
        OptiPlanError: a worker died.
    """
    if processes <= 1 or count <= 1:
        do = work.prepare()
        done: list[R] = []
        for k in range(count):
            done.append(do(k))
            progress((k + 1) / count)
        return done
    context = multiprocessing.get_context("spawn")  # a fork would copy threads' locks
    readers: list[Connection] = []
    workers = []
    for p in range(min(processes, count)):
        reader, writer = context.Pipe(duplex=False)
        worker = context.Process(target=_serve, args=(work, range(p, count, processes), writer), daemon=True)
        worker.start()
        writer.close()
        readers.append(reader)
        workers.append(worker)
    try:
        results: dict[int, R] = _collect(readers, count, progress)
    finally:
        for worker in workers:
            worker.terminate()
            worker.join()
    return [results[k] for k in range(count)]


def _collect(readers: list[Connection], count: int, progress: Callable[[float], None]) -> dict[int, R]:
    results: dict[int, R] = {}
    while len(results) < count:
        for reader in wait(readers):
            assert isinstance(reader, Connection)
            try:
                k, result = reader.recv()
            except EOFError:
                readers.remove(reader)
                if not readers and len(results) < count:
                    raise OptiPlanError("a worker process ended before its work was done") from None
                continue
            results[k] = result
            progress(len(results) / count)
    return results


def _serve(work: ChunkedWork[R], chunks: range, writer: Connection) -> None:
    do = work.prepare()
    for k in chunks:
        try:
            writer.send((k, do(k)))
        except BrokenPipeError:
            return
