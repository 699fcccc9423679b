"""Pool of slots on this machine, each in a thread of its own: tasks in, outcomes out in order of completion."""

import queue
import threading
from collections.abc import Generator, Iterable, Iterator
from typing import Protocol

from optiplan.bench.execution.machine import physical_cores
from optiplan.bench.execution.slot import Stopped, WorkerSlot
from optiplan.bench.results.records import BenchTask, Outcome

PATIENCE = 5.0
"""s that a slot has to end its run."""
LOOK = 0.05
"""s between two looks whether the slots have ended."""


class Workforce(Protocol):
    """Executor of tasks: slots on this machine, or a cluster."""

    def outcomes(self, tasks: Iterable[BenchTask]) -> Generator[Outcome, None, None]:
        """Yield one outcome for every task, in any order; a task is taken from `tasks` only when a slot is free."""
        ...

    def close(self) -> None:
        """End all work at once; runs under way are given up. Safe to call from any thread, and twice."""
        ...


class LocalPool:
    """A fixed number of worker slots on this machine.

    A slot takes its next task before the last outcome is stored: storing costs no slot any time.
    """

    def __init__(self, workers: int, pin: bool = False) -> None:
        """Make the slots.

        Args:
            workers: how many.
            pin: keep each on a core of its own; there must be as many.
        """
        pinned: list[int | None] = list(physical_cores()) if pin else [None] * workers
        self._stop = threading.Event()
        self._lock = threading.Lock()
        self._slots = [WorkerSlot(f"local/{index}", self._stop, pinned[index]) for index in range(workers)]
        self._done: queue.Queue[Outcome | BaseException] = queue.Queue(4 * workers + 4)

    @property
    def starting(self) -> float:
        """Seconds that the slots waited for new workers, in all."""
        return sum(slot.starting for slot in self._slots)

    def outcomes(self, tasks: Iterable[BenchTask]) -> Generator[Outcome, None, None]:
        """Yield the outcomes of tasks, as `Workforce` says.

        Raises:
            WorkerError: no worker can be started.
        """
        shared = iter(tasks)
        threads = [threading.Thread(target=self._serve, args=(slot, shared), daemon=True) for slot in self._slots]
        for thread in threads:
            thread.start()
        try:
            while True:
                working = any(thread.is_alive() for thread in threads)  # before the look: what they put is there then
                try:
                    item = self._done.get(timeout=LOOK if working else 0.0)
                except queue.Empty:
                    if working:
                        continue
                    return
                if isinstance(item, BaseException):
                    raise item
                yield item
        finally:  # also where an outcome cannot be stored: what planners started ends with their slot
            self.close()
            for thread in threads:
                thread.join(PATIENCE)

    def close(self) -> None:
        """End the workers, as `Workforce` says."""
        self._stop.set()

    def _serve(self, slot: WorkerSlot, tasks: Iterator[BenchTask]) -> None:
        """One slot's thread."""
        try:
            while not self._stop.is_set():
                with self._lock:
                    task = next(tasks, None)
                if task is None:
                    break
                self._put(slot.run(task))
        except Stopped:
            pass
        except BaseException as error:
            self._put(error)
        finally:
            slot.close()

    def _put(self, item: Outcome | BaseException) -> None:
        """Put an outcome into the queue; once stopped, only where there is room."""
        while True:
            try:
                return self._done.put(item, timeout=0.1)
            except queue.Full:
                if self._stop.is_set():
                    return None
