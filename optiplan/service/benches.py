"""Benches: every problem meets every planner with every seed, as runs of the queue, and what came of that as tables."""

from collections.abc import Mapping, Sequence
from statistics import median
from typing import Any

from optiplan.service.archive import Archive, has_page
from optiplan.service.execution.run_queue import RunQueue
from optiplan.service.models import BenchPlannerInput, BenchRequest, ProblemInput, Submission
from optiplan.service.queued_plans import QueuedPlans, check_budget, new_run
from optiplan.service.refusals import Refusal, busy, not_found
from optiplan.service.requests import ProblemRequests, digest_of
from optiplan.service.settings import ServiceSettings
from optiplan.service.store.keyed_tables import BROKEN_OFF, UNDER_WAY
from optiplan.service.store.run_table import ENDED, Record, tried_again

MOST = 2000
"""Runs of one bench."""
DRAWING = 120.0
"""s that a report may take."""


class Benches:
    """The benches of a service."""

    def __init__(
        self,
        settings: ServiceSettings,
        archive: Archive,
        requests: ProblemRequests,
        queued: QueuedPlans,
        queue: RunQueue,
    ) -> None:
        self._settings, self._archive, self._requests = settings, archive, requests
        self._queued, self._queue = queued, queue

    async def submit(self, given: BenchRequest) -> Record:
        """Queue the runs of a bench; those that there are of the same submissions are not made again.

        Raises:
            Refusal: a problem or planner is wrong, two have one name, or there are more runs than may wait.
        """
        problems = [ProblemInput(problem=one, name=None, start=None, goal=None) for one in given.problems]
        checked = [await self._requests.check(one) for one in problems]
        labels = [planner.shown for planner in given.planners]
        for what, names in (("problem", [str(one["name"]) for one in checked]), ("planner", labels)):
            if twice := {name for name in names if names.count(name) > 1}:
                raise Refusal(422, f"found the {what} '{min(twice)}' twice; expected names of their own")
        if (count := len(problems) * len(labels) * len(given.seeds)) > MOST:
            raise Refusal(422, f"found {count} runs; expected at most {MOST} in one bench")
        asked: list[Submission] = []
        runs: list[list[Any]] = []
        for one in problems:
            for planner in given.planners:
                mine = [Submission(**_submission(one, planner, given), seed=seed) for seed in given.seeds]
                check_budget(mine[0], self._settings)
                about = await self._requests.check(mine[0])  # before any is queued
                for submission in mine:
                    run = new_run(submission, {**about, "seed": submission.seed})
                    runs.append([run.name, planner.shown, run.seed, run.id])
                asked += mine
        await self._check_room([run for *_, run in runs])
        bench = digest_of([given.name, runs])[:32]
        content = {
            "budget": given.budget,
            "seeds": list(given.seeds),
            "problems": [{"name": about["name"], "hash": about["hash"]} for about in checked],
            "planners": [vars(planner) | {"label": planner.shown} for planner in given.planners],
            "runs": runs,
            "submission": bench,
        }
        await self._archive.write(lambda: self._archive.benches.add(bench, given.name, content, self._queue.holder))
        await self._queue_all(bench, asked)
        return await self.one(bench)

    async def _queue_all(self, bench: str, asked: Sequence[Submission]) -> None:
        """Queue runs until they are all, one is refused, or the bench is cancelled or deleted.

        Asking again for a bench goes on where it was broken off. Two may queue one bench at once: how the other one
        ends is no reason to stop.
        """
        table, cancelled = self._archive.benches, None
        try:
            for submission in asked:
                await self._queued.submit(submission, bench)
                if (cancelled := await self._archive.read(lambda: table.cancelled(bench))) is not False:
                    break
        except BaseException:
            await self._archive.write(lambda: table.break_off(bench))
            raise
        if cancelled is False:
            await self._archive.write(lambda: table.end_queueing(bench))
        elif cancelled:
            await self.cancel(bench)  # again: the last run may have been queued after it was cancelled

    async def one(self, bench: str) -> Record:
        """A bench, with how far it is and what came of it, as `BenchAnswer` says.

        Raises:
            Refusal: there is none of this id.
        """
        row = await self._row(bench)
        ids = [run for _, _, _, run in row["content"]["runs"]]
        records = await self._archive.read(lambda: self._archive.runs.of_ids(ids))
        return _answer(row, records, await self._archive.read(lambda: self._absent(row["content"])))

    async def all(self) -> list[Record]:
        """The last benches."""
        rows = await self._archive.read(lambda: self._archive.benches.newest(50))
        return [await self.one(row["id"]) for row in rows]

    async def cancel(self, bench: str) -> None:
        """Cancel what of a bench has not ended and nobody else wants.

        Raises:
            Refusal: there is none of this id.
        """
        content = (await self._row(bench))["content"]

        def cancel() -> None:
            self._archive.benches.break_off(bench, cancelled=True)
            for *_, run in content["runs"]:
                self._queue.cancel(run, content.get("submission"))  # older benches have none

        await self._archive.write(cancel)

    async def delete(self, bench: str) -> None:
        """Forget a bench; its runs stay.

        Raises:
            Refusal: there is none of this id.
        """
        if not await self._archive.write(lambda: self._archive.benches.delete(bench)):
            raise not_found("bench", bench)

    async def report(self, bench: str) -> bytes:
        """The page that `optiplan bench report` makes of these runs.

        Raises:
            Refusal: there is none of this id, or no run of it has ended.
        """
        row = await self._row(bench)
        content, shown = row["content"], []
        ids = [run for *_, run in content["runs"]]
        records = await self._archive.read(lambda: self._archive.runs.of_ids(ids))
        for problem, label, seed, run in content["runs"]:
            record = records.get(run)
            if record is None or not has_page(record):
                continue
            shown.append({"id": run, "key": [problem, label, seed], **await self._archive.texts(record)})
        if not shown:
            raise Refusal(404, f"no run of the bench '{bench}' has ended with an answer")
        asked = {"suite": {"name": row["name"], **content}, "runs": shown}
        answer = await self._requests.ask(asked, "bench_report", DRAWING, "report")
        return answer.files["report.html"]

    async def _row(self, bench: str) -> Record:
        row = await self._archive.read(lambda: self._archive.benches.get(bench))
        if row is None:
            raise not_found("bench", bench)
        return row

    def _absent(self, content: Mapping[str, Any]) -> str:
        """The status of those runs of a bench that there are not."""
        how = content.get("queueing")
        if how == UNDER_WAY and self._queue.alive(content.get("holder")):
            return "queued"
        return "not queued" if how in (UNDER_WAY, BROKEN_OFF) else "deleted"

    async def _check_room(self, runs: Sequence[str]) -> None:
        """Refuse a bench of which more runs are new than may wait."""
        known = await self._archive.read(lambda: self._archive.runs.of_ids(runs))
        new, most = sum(run not in known or tried_again(known[run]) for run in runs), self._settings.queue
        if new > most:
            raise Refusal(
                422, f"found {new} new runs; expected at most {most}, which is all that may wait here (--queue)"
            )
        waiting = await self._archive.read(self._archive.runs.waiting)
        if waiting + new > most:
            raise busy(f"{waiting} runs are queued; {new} more are too many for this server", 60.0)


def _submission(problem: ProblemInput, planner: BenchPlannerInput, bench: BenchRequest) -> Record:
    return {
        **vars(problem),
        "planner": planner.name,
        "options": planner.options,
        "budget": bench.budget,
        "deadline": None,
    }


def _answer(row: Mapping[str, Any], records: Mapping[str, Record], absent: str) -> Record:
    content = row["content"]
    cells: dict[tuple[str, str], list[str]] = {}
    for problem, label, _, run in content["runs"]:
        cells.setdefault((problem, label), []).append(run)
    counts: dict[str, int] = {}
    for *_, run in content["runs"]:
        status = str(records[run]["status"]) if run in records else absent
        counts[status] = counts.get(status, 0) + 1
    open_ = sum(counts.get(status, 0) for status in ("queued", "running"))
    return {
        "id": row["id"],
        "name": row["name"],
        "created": row["created"],
        "status": "running" if open_ else "done",
        "counts": counts,
        "budget": content["budget"],
        "seeds": content["seeds"],
        "problems": content["problems"],
        "planners": [_summary(label, records, content["runs"]) for label in _labels(content)],
        "cells": [
            {
                "problem": problem,
                "planner": label,
                "runs": runs,
                "pages": [run for run in runs if run in records and has_page(records[run])],
                **_figures([records[run] for run in runs if run in records]),
            }
            for (problem, label), runs in cells.items()
        ],
    }


def _labels(content: Mapping[str, Any]) -> list[str]:
    return [planner["label"] for planner in content["planners"]]


def _summary(label: str, records: Mapping[str, Record], runs: Sequence[Sequence[Any]]) -> Record:
    return {"planner": label, **_figures([records[run] for _, own, _, run in runs if own == label and run in records])}


def _figures(found: Sequence[Record]) -> Record:
    """Figures of some runs: how many have ended, are verified, and of these medians and the best."""
    good = [one for one in found if one["verified"]]
    planned = [one["timings"]["plan"] for one in good if one["timings"]]
    ratios = [one["ratio"] for one in good if one["ratio"] is not None]
    return {
        "kept": len(found),
        "ended": sum(one["status"] in ENDED for one in found),
        "verified": len(good),
        "plan_time": median(planned) if planned else None,
        "ratio": median(ratios) if ratios else None,
        "duration": min((one["duration"] for one in good), default=None),
    }
