"""A workforce on a Dask cluster: the scheduler spreads tasks over its workers, which run them in slots."""

import logging
import queue
import threading
import time
import uuid
import warnings
from asyncio import CancelledError
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import suppress
from dataclasses import replace
from typing import Any, Final

from optiplan.bench.dask import cluster_worker
from optiplan.bench.dask.file_transfer import Packer
from optiplan.bench.results.records import BenchProblem, BenchTask, Outcome, Row, empty_row, failure
from optiplan.errors import OptiPlanError, named_reason

CONNECT = 10.0
"""s within which a scheduler has to answer."""
STARTS = 3
"""Attempts to start the thread of a client, each of which `distributed` ends with an assertion after 10 s."""
WAIT = 300.0
"""s without a single worker after which we give up; a cluster that grows on demand needs some of them."""
LOOK = 2.0
"""s between two looks at how many workers there are."""
AHEAD = 2
"""Tasks on their way for each thread of a worker: one runs, one waits."""
HAND_OVER = 5.0
"""s within which a worker hands over what it has done."""
LOST: Final = "crashed (machine lost)"
"""Kind of failure of a run that took worker after worker with it (Dask's `allowed-failures` says how many)."""


class ClusterError(OptiPlanError):
    """Unusable or lost cluster; earlier results are stored."""


class DaskCluster:
    """Workforce on the workers of a Dask scheduler; runs of a lost worker are repeated elsewhere.

    A run counts when its outcome has arrived here: Dask repeats a task whose worker or result is lost.
    """

    def __init__(self, address: str) -> None:
        """Connect, and compare versions with the workers that are there.

        Raises:
            ClusterError: `distributed` is not installed, nothing answers, or a worker has other versions.
        """
        self.address = address
        self._session = uuid.uuid4().hex
        self._stop = threading.Event()
        self._packer = Packer()
        self._packed: tuple[str, BenchProblem] | None = None
        self._done: queue.Queue[Any] = queue.Queue()
        self._running: dict[Any, tuple[BenchTask, cluster_worker.Bundles]] = {}
        self._client = connected_client(address)
        try:
            self._compare()
        except BaseException:
            self._client.close()
            raise

    @property
    def slots(self) -> int:
        """Threads of all current workers."""
        return sum(self._client.nthreads().values())

    def outcomes(self, tasks: Iterable[BenchTask]) -> Generator[Outcome, None, None]:
        """Yield the outcomes of tasks, as `Workforce` says.

        Raises:
            ClusterError: the scheduler is gone, no worker comes, or one comes with other versions.
        """
        waiting, looked, workers, alone = iter(tasks), 0.0, 0, time.monotonic()
        try:
            while not self._stop.is_set():
                now = time.monotonic()
                if now - looked > LOOK:
                    looked, workers = now, self._check_workers()
                    alone = now if workers else alone
                if now - alone > WAIT:
                    raise ClusterError(f"no worker at {self.address} for {WAIT:g} s")
                while len(self._running) < AHEAD * max(workers, 1):
                    task = next(waiting, None)
                    if task is None:
                        break
                    self._send(task, {})
                if not self._running:
                    return
                yield from self._arrived()
        finally:
            self._end_session()

    def close(self) -> None:
        """End the session, as `Workforce` says."""
        self._stop.set()

    def _check_workers(self) -> int:
        try:
            return self.slots
        except (OSError, ValueError, AttributeError) as error:
            raise self._lost() from error

    def _compare(self) -> None:
        """Refuse workers whose results may differ; those that join later are checked with each task."""
        expected = cluster_worker.signature()
        try:
            answers = self._client.run(cluster_worker.version_differences, dict(expected), on_error="return")
        except (OSError, ValueError) as error:
            raise self._lost() from error
        for worker, words in answers.items():
            if isinstance(words, BaseException):
                raise ClusterError(f"worker {worker} cannot be asked for its versions: {named_reason(words)}; {_SAME}")
            if words:
                raise _mismatch(worker, words)

    def _send(self, task: BenchTask, bundles: cluster_worker.Bundles) -> None:
        packed = replace(task, problem=self._pack(task.problem))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # that a bundle is large
            future = self._client.submit(
                cluster_worker.carry_out,
                self._session,
                cluster_worker.signature(),
                packed,
                bundles,
                pure=False,
                key=uuid.uuid4().hex,
            )
        self._running[future] = task, bundles
        future.add_done_callback(self._done.put)

    def _pack(self, problem: BenchProblem) -> BenchProblem:
        """Pack a problem; tasks come problem by problem, so the last one is cached."""
        if self._packed is None or self._packed[0] != problem.id:
            self._packed = problem.id, self._packer.pack(problem)
        return self._packed[1]

    def _arrived(self) -> Iterator[Outcome]:
        """Return the next outcome, if one arrives before the next check."""
        from distributed import KilledWorker

        try:
            future = self._done.get(timeout=0.2)
        except queue.Empty:
            return
        task, bundles = self._running[future]
        try:
            answer = future.result(timeout=HAND_OVER)
        except TimeoutError as error:
            if future.status == "error":  # the task's own, as of a file system
                raise self._lost(error) from error
            self._done.put(future)  # its worker was lost before the transfer: the run is repeated
            return
        except KilledWorker as error:
            answer = Outcome(Row(**empty_row(task) | failure(LOST, str(error))))
        except OptiPlanError:
            raise
        except Exception as error:
            raise self._lost(error) from error
        del self._running[future]
        if isinstance(answer, Outcome):
            yield replace(answer, row=replace(answer.row, worker=answer.row.worker or self.address))
        elif isinstance(answer, cluster_worker.MissingBundles):
            bundle_contents = {digest: self._packer.bundle_contents(digest) for digest in sorted(answer.digests)}
            self._send(task, {**bundles, **bundle_contents})
        else:
            raise _mismatch("that came later", answer.words)

    def _lost(self, error: BaseException | None = None) -> ClusterError:
        why = f" ({named_reason(error)})" if error is not None else ""
        return ClusterError(f"the Dask cluster at {self.address} fails{why}; what was stored is whole: go on later")

    def _end_session(self) -> None:
        """Cancel running tasks; workers end the processes of this session."""
        if self._client.status == "running":
            self._client.cancel(list(self._running), force=True)
            self._client.run(cluster_worker.end_session, self._session, on_error="ignore")
        self._running.clear()
        self._client.close(timeout=2)


def connected_client(address: str) -> Any:
    """Return a client of the scheduler at an address.

    Raises:
        ClusterError: `distributed` is not installed, or nothing answers.
    """
    try:
        import distributed
    except ImportError as error:
        raise ClusterError("--dask needs distributed: pip install 'optiplan[cluster]'") from error
    logging.getLogger("distributed.client").addFilter(_is_news)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # other versions of Dask: who needs the same ones says so
            return _connect(distributed.Client, address)
    except (OSError, ValueError, TypeError, ImportError, AssertionError) as error:
        expected = "a running one, as of `dask scheduler` (docs/how-to/cluster.md)"
        raise ClusterError(f"no Dask scheduler at {address}: {named_reason(error)}; expected {expected}") from error


def _is_news(record: logging.LogRecord) -> bool:
    """Drop what is said of a reconnection that our `close` ends: the error of the lost scheduler is ours."""
    ended = record.exc_info and isinstance(record.exc_info[1], CancelledError)
    return not (ended or record.getMessage().startswith("Failed to reconnect to scheduler"))


def _connect(client: Callable[..., Any], address: str) -> Any:
    """Return a client of a scheduler; on a crowded machine its thread may not start in time and is tried again."""
    for _ in range(STARTS - 1):
        with suppress(AssertionError):
            return client(address, timeout=CONNECT, set_as_default=False)
    return client(address, timeout=CONNECT, set_as_default=False)


_SAME = "every machine needs the same versions: docs/how-to/cluster.md"


def _mismatch(worker: str, words: Iterable[str]) -> ClusterError:
    return ClusterError(f"worker {worker} has other versions: {'; '.join(words)}; {_SAME}")
