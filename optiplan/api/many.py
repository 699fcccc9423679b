"""`plan_many`: many problems, side by side in processes or on a Dask cluster."""

import pickle
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace
from queue import SimpleQueue
from typing import Any

from optiplan.api.planning import BUDGET, checked_problem, positive_seconds
from optiplan.arrays import is_listed
from optiplan.cores import WHY_DEAD, OneThreadContext, cores
from optiplan.errors import (
    InputError,
    OptiPlanError,
    UnknownChoiceError,
    described,
    options_argument,
    progress_argument,
    whole_argument,
    wrong_argument,
)
from optiplan.planners.base import Budget, Progress, silent
from optiplan.planners.registry import make_planner
from optiplan.problem.from_python import split_expressions
from optiplan.problem.problem import Problem
from optiplan.records import dataclass
from optiplan.runs.batches.workers import end_pool, is_dask_client, submitted
from optiplan.runs.pipeline import answer, chosen, plan_and_verify_once
from optiplan.runs.run import Run


@dataclass(frozen=True, eq=False)
class _Request:
    """One problem with the planner that it is given to, and the seconds for it."""

    problem: Problem
    planner: str
    options: Mapping[str, Any]
    seconds: float


def plan_many(
    problems: Iterable[Problem],
    planner: str | None = None,
    options: Mapping[str, Any] | None = None,
    budget: float = BUDGET,
    *,
    workers: int | Any = None,
    progress: Progress | None = None,
) -> Iterator[Run]:
    """Plan many problems at a time; the runs come in the order of the problems, each as soon as those before it have.

    Args:
        problems: of `op.Problem` or `op.load_problem`, each with a seed of its own.
        planner: a name of `op.planners()`, or `module:Class`; None: each problem's own.
        options: of that planner, as of `op.plan`.
        budget: seconds of wall time for planning and proof of each.
        workers: how many processes, each on one core; None: as many as this process may use cores. Or a Dask client
            (`distributed.Client`), on whose workers, with the same versions and files, the problems are planned.
        progress: called, in this thread, with the name of a problem whenever one is done, and the fraction (0 to 1) of
            all that are done.

    Returns:
        An iterator of runs, one a problem, each as of `op.plan`. What a planner raises for one problem is the `failure`
        of its run, of kind `input` or `bug`, and ends no other. Work begins at the call; closing the iterator ends it.

    Raises:
        InputError: at once: an argument that does not fit, no such planner.
        OptiPlanError: on the way: a worker process died, or the cluster failed. Runs that came before are whole.

    A script that calls it guards its own start with `if __name__ == "__main__":`, since the processes import it.

    Example:
        >>> import optiplan as op
        >>> problems = [op.load_problem("12_planar", seed=seed) for seed in range(2)]
        >>> all(run.verified for run in op.plan_many(problems, workers=2))  # doctest: +SKIP
        True
    """
    progress_argument("plan_many", progress)
    requests = _requests(problems, planner, options, positive_seconds("plan_many", budget))
    if is_dask_client(workers):
        client: Any = workers
        there = [client.submit(_planned, one, pure=False) for one in requests]
        return _Runs(_ordered(requests, [_arriving(one) for one in there], progress), lambda: client.cancel(there))
    if workers is not None:
        whole_argument("plan_many", "workers", workers, 1, "a whole number >= 1, or a Dask client (distributed.Client)")
    _check_functions(requests)
    count = min(workers or cores(), max(len(requests), 1))
    pool = ProcessPoolExecutor(count, OneThreadContext())
    futures = [submitted(pool, _planned, one) for one in requests]
    return _Runs(_ordered(requests, futures, progress), lambda: end_pool(pool))


class _Runs(Iterator[Run]):
    """The runs in order; their end, `close` or dropping them ends the work, also before the first one."""

    def __init__(self, runs: Generator[Run, None, None], end: Callable[[], None]) -> None:
        self._runs = runs
        self._end: Callable[[], None] | None = end

    def __repr__(self) -> str:
        """What is to be done with them."""
        return "Runs, each once and in order: for run in op.plan_many(…)"

    def __next__(self) -> Run:
        try:
            return next(self._runs)
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """End the work, once: its pool or client may be gone by the next time."""
        end, self._end = self._end, None
        if end is not None:
            try:
                self._runs.close()
            finally:  # `close` of the generator fails when `progress` calls it
                end()

    __del__ = close


def _requests(problems: Any, planner: str | None, options: Mapping[str, Any] | None, seconds: float) -> list[_Request]:
    """Return what is asked for, once everything that holds for all problems is known to fit."""
    if isinstance(problems, Problem) or not is_listed(problems):
        raise wrong_argument("plan_many", "problems", described(problems), "a list of problems, of op.load_problem(…)")
    if planner is not None and not isinstance(planner, str):
        raise wrong_argument("plan_many", "planner", described(planner), "the name of a planner, or `module:Class`")
    options_argument("plan_many", options)
    given = list(problems)
    for k, problem in enumerate(given):
        checked_problem(problem, "plan_many", f"problems[{k}]")
    if planner is not None:
        try:
            make_planner(planner, options or {})
        except UnknownChoiceError as error:
            raise error.of_argument("plan_many", "planner" if error.kind == "planner" else "options") from None
    return [_Request(problem, *chosen(problem, planner, options), seconds) for problem in given]


def _check_functions(requests: Sequence[_Request]) -> None:
    """Refuse expressions whose function no other process can load, before anything is planned."""
    for k, request in enumerate(requests):
        for one in split_expressions(request.problem.path_constraints)[1]:
            try:
                pickle.dumps(one.build)
            except Exception:  # whatever a function of the user holds
                found = f"the expression '{one.name}', whose function no other process can load"
                expected = "a function that a module defines (`def`, no lambda)"
                raise wrong_argument("plan_many", f"problems[{k}]", found, expected) from None


def _planned(request: _Request) -> Run:
    """Plan one problem, in a worker."""
    budget = Budget(request.seconds)
    return plan_and_verify_once(request.problem, request.planner, request.options, budget, silent, by=answer)


def _arriving(there: Any) -> "Future[Run]":
    """Return a future of a Dask cluster as one of Python's own."""
    future: Future[Run] = Future()

    def arrived(one: Any) -> None:
        try:
            future.set_result(one.result())
        except BaseException as error:  # whatever it is, the iterator must not wait for ever
            future.set_exception(error)

    there.add_done_callback(arrived)
    return future


def _ordered(
    requests: Sequence[_Request], futures: "Sequence[Future[Run]]", progress: Progress | None
) -> Generator[Run, None, None]:
    """Yield the runs in order."""
    names = {future: one.problem.name for future, one in zip(futures, requests, strict=True)}
    arrived, done = SimpleQueue[Future[Run]](), set[Future[Run]]()
    for future in futures:
        future.add_done_callback(arrived.put)
    try:
        for request, future in zip(requests, futures, strict=True):
            while future not in done:
                done.add(one := arrived.get())
                if progress is not None:
                    progress(names[one], len(done) / len(futures))
            yield replace(_answer(future, request), problem=request.problem)
    finally:
        for future in set(futures) - done:
            future.cancel()


def _answer(future: "Future[Run]", request: _Request) -> Run:
    name = request.problem.name
    try:
        return future.result()
    except BrokenProcessPool:
        told = f"a worker process died before '{name}' was planned: {WHY_DEAD}; runs before it are whole"
        raise OptiPlanError(f"op.plan_many: {told}") from None
    except InputError as error:  # a worker could not read the problem
        raise OptiPlanError(f"op.plan_many: a worker cannot read '{name}': {error}") from None
    except Exception as error:
        raise OptiPlanError(f"op.plan_many: '{name}' was lost ({type(error).__name__}: {error})") from error
