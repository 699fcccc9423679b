"""Small pictures of runs and problems, kept in memory, and pages of runs."""

from collections.abc import Awaitable, Callable, Sequence
from typing import Any

from optiplan.cache import MostRecent
from optiplan.runs.run_folder import TRAJECTORY
from optiplan.service.archive import Archive
from optiplan.service.models import ProblemInput
from optiplan.service.refusals import Refusal
from optiplan.service.requests import ProblemRequests
from optiplan.service.store.run_table import Record

REMEMBERED = 1000
"""Pictures of some 10 kB each."""


class Pictures:
    """Draw runs and problems by solver processes."""

    def __init__(self, archive: Archive, requests: ProblemRequests) -> None:
        self._archive, self._requests = archive, requests
        self._drawn: MostRecent[bytes] = MostRecent(REMEMBERED)

    async def of_run(self, record: Record) -> bytes:
        """Return the scene of a run, with its motion if there is one.

        Raises:
            Refusal: its problem can no longer be read.
        """

        async def request() -> dict[str, Any]:
            asked = {**await self._archive.stored_request(record), "hash": record["problem"]}
            if TRAJECTORY in (record["contents"] or {}):
                asked["motion"] = (await self._archive.content(record, TRAJECTORY)).decode()
            return asked

        return await self._kept(f"{record['id']} {record['finished']}", request)

    async def of_problem(self, hash: str) -> bytes:
        """Return the scene of a stored problem.

        Raises:
            Refusal: none is stored under this hash, or it can no longer be read.
        """
        given = ProblemInput(problem=hash, name=None, start=None, goal=None)
        return await self._kept(hash, lambda: self._requests.of(given))

    async def page(self, *records: Record, labels: Sequence[str] = (), drawn: str = "") -> bytes:
        """Return the page of one ended run, or of several runs of one problem.

        Args:
            records: the runs.
            labels: of the runs; empty: the names of their planners.
            drawn: where the page gets what scripts draw, if it does.

        Raises:
            Refusal: one has no record, they are of different problems, or there are more or fewer labels than runs.
        """
        if labels and len(labels) != len(records):
            raise Refusal(422, f"found {len(labels)} labels of {len(records)} runs; expected one for each, or none")
        if len({record["problem"] for record in records}) > 1:
            raise Refusal(422, "these runs are of different problems; expected runs of one")
        shown = [await self._archive.texts(record) for record in records]
        asked = await self._archive.stored_request(records[0])
        of = {"runs": shown, "ids": [record["id"] for record in records], "labels": list(labels), "drawn": drawn}
        return (await self._requests.ask({**asked, **of}, "page")).files["page.html"]

    async def _kept(self, key: str, request: Callable[[], Awaitable[dict[str, Any]]]) -> bytes:
        found = self._drawn.find(key)
        if found is None:
            drawn = await self._requests.ask(await request(), "picture")
            found = self._drawn.keep(key, drawn.files["picture.svg"])
        return found
