"""Plans in the durable queue: submission, deletion, and the identity of a run."""

import json
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import optiplan
from optiplan.service.archive import Archive
from optiplan.service.execution.run_queue import RunQueue
from optiplan.service.models import Submission
from optiplan.service.refusals import Refusal, busy
from optiplan.service.requests import ProblemRequests, digest_of
from optiplan.service.settings import ServiceSettings
from optiplan.service.store.contents import ContentFolder
from optiplan.service.store.run_table import ENDED, NewRun, Record, tried_again


class QueuedPlans:
    """Submit plans to the queue, and delete them."""

    def __init__(self, settings: ServiceSettings, archive: Archive, requests: ProblemRequests, queue: RunQueue) -> None:
        self._settings, self._archive, self._requests, self._queue = settings, archive, requests, queue

    async def submit(self, submission: Submission, name: str) -> Record:
        """Queue a run and return it; the same submission returns the same run.

        Args:
            submission: what to plan.
            name: of this submission, for `queue.cancel`.

        Raises:
            Refusal: the problem cannot be planned, or the queue is full.
            StorageFullError: the disk is full.
        """
        check_budget(submission, self._settings)
        about = await self._requests.check(submission)
        request = await self._requests.of(submission)
        return await self._archive.write(lambda: self._submit(submission, name, about, request))

    def _submit(self, submission: Submission, name: str, about: Mapping[str, Any], request: Record) -> Record:
        contents, runs = self._archive.contents, self._archive.runs
        new = new_run(submission, about)
        known = runs.get(new.id)
        if known is not None and known["status"] in ENDED and not tried_again(known):
            return known
        contents.check_room()
        waits = known is not None and known["status"] in ("queued", "running")
        if not waits and (waiting := runs.waiting()) >= self._settings.queue:
            raise busy(f"{waiting} runs are queued, which is all that this server takes", min(60.0, 0.1 * waiting))
        record, fresh = runs.submit(with_request(new, request, contents), name)
        if fresh:
            self._queue.wake()
        return record

    def forget(self, run: str) -> None:
        """Delete a run that has ended."""
        self._archive.runs.delete(run)


def check_budget(submission: Submission, settings: ServiceSettings) -> None:
    """Raise a `Refusal` if the budget is larger than this server allows."""
    most = settings.most_budget
    if submission.budget > most:
        raise Refusal(422, f"budget: found {submission.budget:g} s; expected at most {most:g} s on this server")


def new_run(submission: Submission, about: Mapping[str, Any]) -> NewRun:
    """Return the run of a submission, without its request; its id is the digest of all that determines the answer."""
    asked = [about[key] for key in ("hash", "planner", "options", "seed")]
    asked += [submission.budget, submission.deadline, optiplan.__version__]
    asked += [submission.warm_start] if submission.warm_start else []
    return NewRun(
        id=digest_of(asked)[:32],
        name=about["name"],
        problem=about["hash"],
        robot=about["robot"],
        request="",
        planner=about["planner"],
        seed=about["seed"],
        budget=submission.budget,
        deadline=submission.deadline,
    )


def with_request(new: NewRun, request: Record, contents: ContentFolder) -> NewRun:
    """Return a run with its request, which is stored."""
    content = json.dumps(request).encode()
    return replace(new, request=contents.put(content), bytes=len(content))
