"""Plans that callers wait for, past the queue: answered as soon as there is a motion, kept after that."""

import asyncio
import logging
import time
import uuid
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from sqlalchemy.exc import SQLAlchemyError

from optiplan.errors import OptiPlanError
from optiplan.records import dataclass
from optiplan.runs.run_folder import RUN, TRAJECTORY
from optiplan.service.archive import Archive
from optiplan.service.execution.event_writer import AWAY, RETRY
from optiplan.service.execution.run_solver import GRACE, LEAD, RunSolver
from optiplan.service.execution.solver_pool import POLL, SolverAnswer, SolverJob, SolverPool
from optiplan.service.models import PlanRequest
from optiplan.service.queued_plans import check_budget, new_run, with_request
from optiplan.service.refusals import Refusal, busy
from optiplan.service.requests import ProblemRequests, refusal_of
from optiplan.service.settings import ServiceSettings
from optiplan.service.store.run_table import NewRun, Record

_log = logging.getLogger("optiplan.service")

WAITING = 8
"""Callers per interactive process that may wait for it."""
LOOK = 0.25
"""s between two looks whether the caller has gone."""


@dataclass(frozen=True)
class WaitedRun:
    """A run that a caller waited for, its trajectory.json, and what begins to keep it, once it is answered."""

    record: Record
    motion: bytes | None
    keep: Callable[[], Any]


class WaitedPlans:
    """The plans of a service that callers wait for."""

    def __init__(
        self,
        settings: ServiceSettings,
        archive: Archive,
        requests: ProblemRequests,
        pool: SolverPool,
        solver: RunSolver,
    ) -> None:
        self._settings, self._archive, self._requests = settings, archive, requests
        self._pool, self._solver = pool, solver
        self._tasks: set[asyncio.Task[None]] = set()

    async def finish(self) -> None:
        """Wait until all runs that were answered are kept."""
        await asyncio.gather(*self._tasks)

    async def plan(self, submission: PlanRequest, gone: Callable[[], Any]) -> WaitedRun:
        """Plan while the caller waits.

        Args:
            submission: what to plan.
            gone: awaited now and then: whether the caller has gone, so that nobody wants the answer.

        Raises:
            Refusal: the problem cannot be planned, too many callers wait.
            StorageFullError, DatabaseAwayError: the run could not be kept; nothing is planned.
        """
        check_budget(submission, self._settings)
        request, began = await self._requests.of(submission), time.time()
        if (fault := await self._archive.write(self._archive.probe.fault)) is not None:
            raise fault
        if self._pool.waiting("plan") >= WAITING * self._settings.interactive:
            raise busy("too many callers wait for a plan", 1.0)
        left = submission.deadline or float("inf")
        asked = {
            **request,
            "do": "plan",
            "early": True,
            "rate": submission.rate,
            "budget": max(LEAD, min(submission.budget, left - LEAD)),
        }
        wall = self._settings.reading + submission.budget + GRACE
        job = SolverJob(asked, wall, until=time.monotonic() + left)
        answer, whole = await self._answer(job, gone)
        if "error" in answer.data:
            raise refusal_of(answer)
        if answer.death is not None:
            late = answer.death == "timeout" and left < wall
            raise Refusal(504 if answer.death == "timeout" else 503, "deadline" if late else answer.detail)
        # An attempt has an id of its own: within a budget of time, the next one finds another motion.
        new = replace(new_run(submission, answer.data), id=uuid.uuid4().hex)
        record = {**vars(new), **answer.data, "status": "failed" if answer.data["failure"] else "done"}
        record |= {"submitted": began, "started": began, "finished": time.time()}
        record["contents"] = {RUN: ""}  # which is kept after the answer, and whose digest is known then
        return WaitedRun(record, answer.files.get(TRAJECTORY), self._keeper(new, request, whole, began))

    async def _answer(
        self, job: SolverJob, gone: Callable[[], Any]
    ) -> tuple[SolverAnswer, "asyncio.Future[SolverAnswer]"]:
        """What a process answers as soon as the caller can use it, and the whole of it, which comes later.

        A job that no process has begun when its time is over is not waited for any longer.
        """
        early, whole = self._pool.submit_early("plan", job)
        while True:
            wait = min(LOOK, max(POLL, job.until - time.monotonic()))
            await asyncio.wait([early, whole], timeout=wait, return_when=asyncio.FIRST_COMPLETED)
            if early.done() or whole.done():
                return (early if early.done() else whole).result(), whole
            if not job.future.running() and (late := job.too_late()) is not None:
                job.cancel.set()
                return late, whole
            if await gone():
                job.cancel.set()

    async def _until_written(self, write: Callable[[], None]) -> None:
        """Have something written, once the database takes it."""
        while True:
            try:
                return await self._archive.write(write)
            except AWAY as error:
                _log.warning("a run that was answered is kept later: %s", error)
                await asyncio.sleep(RETRY)

    def _keeper(
        self, new: NewRun, request: Record, whole: "asyncio.Future[SolverAnswer]", began: float
    ) -> Callable[[], Any]:
        """What begins to keep a run that was waited for, once it is answered; who asks for the run until then waits."""
        saved = self._archive.saving[new.id] = asyncio.get_running_loop().create_future()

        async def keep() -> None:
            try:
                end = await whole

                def write() -> None:
                    self._archive.contents.check_room()
                    kept = with_request(new, request, self._archive.contents)
                    self._archive.runs.add_ended(kept, self._solver.ended(end), began)

                if end.death is None:
                    await self._until_written(write)
                else:
                    _log.warning("run %s is not kept: %s: %s", new.id, end.death, end.detail)
            except (OptiPlanError, SQLAlchemyError, OSError) as error:  # costs the record, not the answer
                _log.warning("run %s is not kept: %s", new.id, error)
            finally:
                self._archive.saving.pop(new.id, None)
                saved.set_result(None)

        async def begin() -> None:  # on its own: the connection is free for the next request meanwhile
            task = asyncio.ensure_future(keep())
            self._tasks.add(task)
            task.add_done_callback(self._tasks.discard)

        return begin
