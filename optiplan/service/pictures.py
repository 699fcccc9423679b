"""Small pictures of runs and problems, drawn when somebody looks, and remembered."""

from collections import OrderedDict
from collections.abc import Awaitable, Callable
from typing import Any

from optiplan.runs.run_folder import TRAJECTORY
from optiplan.service.models import ProblemInput
from optiplan.service.run_service import RunService
from optiplan.service.store.run_table import Record

REMEMBERED = 1000
"""Pictures of some 10 kB each."""


class Pictures:
    """Pictures of the runs and problems of a service."""

    def __init__(self, service: RunService) -> None:
        self._service = service
        self._drawn: OrderedDict[str, bytes] = OrderedDict()

    async def of_run(self, record: Record) -> bytes:
        """The scene of a run, with its motion where it has one.

        Raises:
            Refusal: its problem cannot be read any more.
        """

        async def request() -> dict[str, Any]:
            asked = await self._service.stored_request(record)
            if TRAJECTORY in (record["contents"] or {}):
                asked["motion"] = (await self._service.content(record, TRAJECTORY)).decode()
            return asked

        return await self._kept(f"{record['id']} {record['finished']}", request)

    async def of_problem(self, hash: str) -> bytes:
        """The scene of a stored problem.

        Raises:
            Refusal: none is stored under this hash, or it cannot be read any more.
        """

        async def request() -> dict[str, Any]:
            return await self._service.request(ProblemInput(problem=hash, name=None, start=None, goal=None))

        return await self._kept(hash, request)

    async def _kept(self, key: str, request: Callable[[], Awaitable[dict[str, Any]]]) -> bytes:
        if key not in self._drawn:
            self._drawn[key] = (await self._service.ask(await request(), "picture")).files["picture.svg"]
            if len(self._drawn) > REMEMBERED:
                self._drawn.popitem(last=False)
        self._drawn.move_to_end(key)
        return self._drawn[key]
