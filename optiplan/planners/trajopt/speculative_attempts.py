"""Attempts in parallel: threads work on the likely next ones."""

import threading
from collections.abc import Iterable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from dataclasses import field
from itertools import islice
from typing import NamedTuple

from optiplan._core import core
from optiplan.arrays import Array
from optiplan.collision.native_model import planning_model
from optiplan.planners.base import Budget
from optiplan.planners.trajopt.optimizer import Attempt, AttemptOptions, Optimiser
from optiplan.planners.trajopt.options import TrajOptOptions
from optiplan.planners.trajopt.program.iteration_log import IterationLog
from optiplan.planners.trajopt.program.sqp import SLOW
from optiplan.records import dataclass

_POLL = 0.02
"""s between two checks of the budget while another thread finishes the attempt."""


class AttemptOutcome(NamedTuple):
    """Result of an attempt.

    Attributes:
        attempt: as `Optimiser.run` returns it.
        steps: taken.
        first: its first curve that was free; None without one.
        log: of its iterations.
    """

    attempt: Attempt | None
    steps: int
    first: Attempt | None
    log: IterationLog


@dataclass(eq=False)
class _Begun:
    """An attempt in another thread, begun with what was known then."""

    best: float
    patient: bool
    future: "Future[AttemptOutcome]"
    cancel: threading.Event = field(default_factory=threading.Event)

    def holds(self, best: float, patient: bool) -> bool:
        """Return whether an attempt begun now has the same outcome.

        The best cost and patience matter only to descents of `SLOW` steps or more.
        """
        if (self.best, self.patient) == (best, patient):
            return True
        return self.future.result().steps < SLOW

    def end(self) -> None:
        """Have it end soon, or never begin."""
        self.future.cancel()
        self.cancel.set()


class SpeculativeAttempts:
    """Runs attempts in `workers` - 1 threads before it is known whether they are needed.

    The planner decides one attempt after the other, as without threads. Before each it names the likely next ones
    (`precompute`), and takes the outcome of one that it needs (`take`). An attempt depends only on its initial curve
    and the best motion so far. So any number of threads gives the same bits, unless the clock ends an attempt.

    Threads gain only where the native core does the work. CasADi's evaluation of path constraints and costs hardly
    releases the interpreter; there, and without the core, no thread is begun.
    """

    def __init__(self, optimiser: Optimiser, budget: Budget) -> None:
        self._like, self._budget = optimiser, budget
        problem, workers = optimiser.problem, optimiser.options.workers
        native = core is not None and problem.objective.plain and not problem.path_constraints
        self._threads = ThreadPoolExecutor(workers - 1) if native and workers > 1 else None
        self._own = threading.local()
        self._tasks: dict[bytes, _Begun] = {}
        self.used = 0

    def precompute(self, curves: Iterable[Array], best: float, patient: bool) -> None:
        """Begin attempts from the first of these curves (K, n); end all others."""
        if self._threads is None:
            return
        wanted = {control.tobytes(): control for control in islice(curves, self._like.options.workers)}
        for key in self._tasks.keys() - wanted.keys():
            self._tasks.pop(key).end()
        for key, control in wanted.items():
            if key not in self._tasks:
                cancel = threading.Event()
                future = self._threads.submit(self._run, self._like.options, control, best, patient, cancel)
                self._tasks[key] = _Begun(best, patient, future, cancel)

    def take(self, control: Array, budget: Budget, best: float, patient: bool) -> AttemptOutcome | None:
        """Return the outcome of the attempt from a curve (K, n); None where no thread has begun it, or not this one."""
        task = self._tasks.pop(control.tobytes(), None)
        if task is None or task.future.cancel():
            return None
        try:
            while not wait([task.future], timeout=_POLL).done:
                if budget.over:
                    task.end()
                    return None
        except BaseException:  # somebody interrupts: `close` knows this task no more
            task.end()
            raise
        if not task.holds(best, patient):
            return None
        self.used += 1
        return task.future.result()

    def close(self) -> None:
        """End all threads."""
        for task in self._tasks.values():
            task.end()
        self._tasks.clear()
        if self._threads is not None:
            self._threads.shutdown()

    def _run(
        self, options: TrajOptOptions, control: Array, best: float, patient: bool, cancel: threading.Event
    ) -> AttemptOutcome:
        """Run an attempt in a thread, which has a collision model of its own."""
        optimiser: Optimiser | None = getattr(self._own, "optimiser", None)
        if optimiser is None or optimiser.options is not options:
            problem = self._like.problem
            model = planning_model(problem.robot, problem.scene, error=problem.tracking_error)
            optimiser = self._own.optimiser = Optimiser(problem, model, options)
        free = list[Attempt]()
        budget = Budget(self._budget.remaining, cancel)
        attempt = optimiser.run(control, budget, AttemptOptions(None, best, patient, free.append))
        return AttemptOutcome(attempt, optimiser.taken, free[0] if free else None, optimiser.log)
