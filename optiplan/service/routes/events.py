"""Route of a run's events: stages, best motions so far, the end; as server-sent events."""

import asyncio
import json
from collections.abc import AsyncIterator
from functools import partial
from typing import Any

from fastapi import APIRouter, Request
from sse_starlette.sse import EventSourceResponse

from optiplan.service.planner_service import PlannerService
from optiplan.service.routes.answers import RunPath, Service, errors
from optiplan.service.store.run_table import ENDED

router = APIRouter(prefix="/api")

LOOK = 0.1
"""s between two looks for news."""
BEAT = 15
"""s between two signs of life on a quiet line."""


class EventFeed:
    """Looks for news of all watched runs at once, as long as any is watched."""

    def __init__(self, service: PlannerService) -> None:
        self._service = service
        self._watchers: dict[str, dict[asyncio.Queue[dict[str, Any]], int]] = {}
        self._task: asyncio.Task[None] | None = None

    async def events(self, run: str) -> AsyncIterator[dict[str, Any]]:
        """The events of a run, those that were first, until it has ended."""
        queue: asyncio.Queue[dict[str, Any]] = asyncio.Queue()
        self._watchers.setdefault(run, {})[queue] = 0
        if self._task is None or self._task.done():
            self._task = asyncio.ensure_future(self._look())
        try:
            while True:
                try:
                    event = await asyncio.wait_for(queue.get(), 1.0)
                except TimeoutError:  # an end that left no event: cancelled while it waited
                    record = await self._service.run(run)
                    if record["status"] not in ENDED or not queue.empty():
                        continue
                    event = {"type": "end", "status": record["status"], "verified": record["verified"]}
                yield event
                if event["type"] == "end" and queue.empty():
                    return
        finally:
            del self._watchers[run][queue]
            if not self._watchers[run]:
                del self._watchers[run]

    async def _look(self) -> None:
        while self._watchers:
            after = min(seen for queues in self._watchers.values() for seen in queues.values())
            look = partial(self._service.runs.events_after, after, list(self._watchers))
            found = await self._service.read(look)
            for number, run, data in found:
                for queue, seen in list(self._watchers.get(run, {}).items()):
                    if number > seen:
                        self._watchers[run][queue] = number
                        queue.put_nowait(data)
            await asyncio.sleep(LOOK)


@router.get(
    "/runs/{run}/events",
    responses={
        200: {"content": {"text/event-stream": {}}, "description": "status, stage, best, end"},
        **errors(404, 422),
    },
    response_class=EventSourceResponse,
)
async def events(run: RunPath, service: Service, request: Request) -> EventSourceResponse:
    """Watch a run: `status`, `stage` (with fraction), `best` (seconds, duration of a verified motion), `end`.

    Of a run that has ended, what happened then.
    """
    record = await service.run(run)
    feed: EventFeed = request.app.state.feed

    async def lines() -> AsyncIterator[dict[str, str]]:
        if record["status"] in ENDED:
            then = await service.read(lambda: service.runs.events_after(0, [run]))
            end = {"type": "end", "status": record["status"], "verified": record["verified"]}
            for data in (*(one for _, _, one in then if one["type"] != "end"), end):
                yield {"event": data["type"], "data": json.dumps(data)}
            return
        yield {"event": "status", "data": json.dumps({"type": "status", "status": record["status"]})}
        async for data in feed.events(run):
            yield {"event": data["type"], "data": json.dumps(data)}

    return EventSourceResponse(lines(), ping=BEAT)
