"""Episodes planned side by side, in processes or on a Dask cluster, in the order of the requests."""

import signal
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from itertools import chain, islice
from typing import Any, TypeVar

from optiplan.cores import WHY_DEAD, OneThreadContext
from optiplan.errors import OptiPlanError
from optiplan.runs.batches.episode import CRASHED, Episode, EpisodeRequest, digest_of, planned_episode

Request = TypeVar("Request")
Result = TypeVar("Result")

AHEAD = 3
"""Episodes in hand for each worker: while the oldest one is waited for, the others have something to do."""

CHILD_LIFE = 2000
"""Episodes of each process after which all are replaced by new ones, against memory that libraries do not give back."""


def is_dask_client(workers: Any) -> bool:
    """Return whether this is a client of Dask, without loading Dask."""
    return type(workers).__module__.split(".")[0] == "distributed" and hasattr(workers, "submit")


def in_processes(requests: Iterable[EpisodeRequest], count: int) -> Iterator[Episode]:
    """Yield the episodes in order; a process that dies costs only the episode that kills it again, alone."""
    source = iter(requests)  # and not `max_tasks_per_child`, which may leave a pool without processes (gh-115634)
    while (first := next(source, None)) is not None:
        yield from _in_one_pool(chain([first], islice(source, CHILD_LIFE * count - 1)), count)


def _in_one_pool(source: Iterator[EpisodeRequest], count: int) -> Iterator[Episode]:
    pending = deque[tuple[EpisodeRequest, Future[Episode]]]()
    pool = _pool(count)
    try:
        while True:
            while len(pending) < AHEAD * count and (request := next(source, None)) is not None:
                pending.append((request, submitted(pool, planned_episode, request)))
            if not pending:
                return
            request, future = pending[0]
            try:
                episode = future.result()
            except BrokenProcessPool:
                end_pool(pool)
                suspects = list(pending)
                pending.clear()
                pool = _pool(count)
                for request, future in suspects:
                    whole = future.done() and not future.cancelled() and future.exception() is None
                    yield future.result() if whole else _alone(request)
                continue
            pending.popleft()
            yield episode
    finally:
        end_pool(pool)


def on_cluster(requests: Iterable[EpisodeRequest], client: Any) -> Iterator[Episode]:
    """Yield the episodes in order, planned by the workers of a `distributed.Client`, which see the same files.

    Raises:
        OptiPlanError: the cluster failed; its episodes have no rows, so that a later call plans them.
    """
    from distributed import KilledWorker

    source, pending = iter(requests), deque[tuple[EpisodeRequest, Any]]()
    try:
        while True:
            with _cluster_errors("the cluster failed"):
                slots = sum(client.nthreads().values()) or 1
                while len(pending) < AHEAD * slots and (request := next(source, None)) is not None:
                    pending.append((request, client.submit(planned_episode, request, pure=False)))
            if not pending:
                return
            request, future = pending.popleft()
            try:
                with _cluster_errors(f"'{request.file}' was lost"):
                    episode = future.result()
            except KilledWorker as error:
                episode = _crashed(request, str(error))
            yield episode
    finally:
        with suppress(Exception):  # a client that is closed has nothing to cancel
            client.cancel([future for _, future in pending])


@contextmanager
def _cluster_errors(what: str) -> Iterator[None]:
    """Raise what a cluster raises as an `OptiPlanError`, but for a worker that died of its episode."""
    from distributed import KilledWorker

    try:
        yield
    except KilledWorker:
        raise
    except Exception as error:
        why = f"{what} ({type(error).__name__}: {error}); rows before that are kept"
        raise OptiPlanError(f"op.plan_batch: {why}") from error


def submitted(pool: ProcessPoolExecutor, do: Callable[[Request], Result], request: Request) -> "Future[Result]":
    """Return the future of a request, which has failed where a process of the pool died since the last one."""
    try:
        return pool.submit(do, request)
    except BrokenProcessPool as error:
        failed: Future[Result] = Future()
        failed.set_exception(error)
        return failed


def _alone(request: EpisodeRequest) -> Episode:
    """Plan an episode in a process of its own."""
    pool = _pool(1)
    try:
        return pool.submit(planned_episode, request).result()
    except BrokenProcessPool:
        return _crashed(request, f"its process died: {WHY_DEAD}")
    finally:
        end_pool(pool)


def _crashed(request: EpisodeRequest, detail: str) -> Episode:
    seed = -1 if request.seed is None else request.seed
    return Episode(request.file, digest_of(request.root / request.file), seed, CRASHED, detail)


def _pool(count: int) -> ProcessPoolExecutor:
    return ProcessPoolExecutor(count, OneThreadContext(), initializer=_begin)


def _begin() -> None:
    """Begin a process that its parent ends: Ctrl-C reaches all processes of a terminal."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def end_pool(pool: ProcessPoolExecutor) -> None:
    """End the processes at once, whatever they do."""
    workers = list((pool._processes or {}).values())
    pool.shutdown(wait=False, cancel_futures=True)
    for worker in workers:
        worker.terminate()
