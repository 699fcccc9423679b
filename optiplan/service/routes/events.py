"""Route of a run's events: stages, best motions so far, the end; as server-sent events."""

import asyncio
import json
import logging
from collections.abc import AsyncIterator
from functools import partial
from typing import Annotated, Any

import anyio
import sqlalchemy as sa
from fastapi import APIRouter, Header, Request
from sse_starlette.sse import EventSourceResponse

from optiplan.errors import OptiPlanError
from optiplan.service.archive import Archive
from optiplan.service.refusals import Refusal
from optiplan.service.routes.answers import RunPath, Service, errors
from optiplan.service.store.run_table import ENDED, Record
from optiplan.service.streams import Lines, event_stream, next_of

router = APIRouter(prefix="/api")

LOOK = 0.1
"""s between two looks for news."""
RETRY = 1.0
"""s between two looks while the database is away, and before a client comes back."""

_log = logging.getLogger("optiplan.service")

Numbered = tuple[int | None, dict[str, Any]]
"""An event with its number; without one, it is not in the database."""


class EventFeed:
    """Looks for news of all watched runs at once, as long as any is watched."""

    def __init__(self, archive: Archive) -> None:
        self._archive = archive
        self._watchers: dict[str, dict[asyncio.Queue[Numbered], int]] = {}
        self._task: asyncio.Task[None] | None = None

    async def events(self, run: str, after: int, stopping: anyio.Event) -> AsyncIterator[Numbered]:
        """The events of a run after the one of a number, until it has ended or the server stops.

        While the database is away there is no news; afterwards it goes on where it was.
        """
        queue: asyncio.Queue[Numbered] = asyncio.Queue()
        self._watchers.setdefault(run, {})[queue] = after
        if self._task is None or self._task.done():
            self._task = asyncio.ensure_future(self._look())
        ended: Numbered | None = None
        try:
            while True:
                news = await next_of(queue, stopping, RETRY)
                if news is None and stopping.is_set():
                    yield None, {"type": "stopping", "detail": "the server stops; the run goes on where one works"}
                    return
                if news is not None:
                    ended = None
                else:  # an end is believed the second time: its events may come a moment after its state
                    news, ended = ended, await self._unreported_end(run)
                    if news is None or not queue.empty():
                        continue
                yield news
                if news[1]["type"] == "end":
                    return
        finally:
            del self._watchers[run][queue]
            if not self._watchers[run]:
                del self._watchers[run]

    async def _unreported_end(self, run: str) -> Numbered | None:
        """The end of a run that left no event: one that was seen already, or of an older database."""
        try:
            record = await self._archive.run(run)
        except Refusal:  # it was deleted meanwhile
            return None, {"type": "end", "status": "cancelled", "verified": None}
        except (OptiPlanError, sa.exc.SQLAlchemyError):
            return None
        return (None, _end(record)) if record["status"] in ENDED else None

    async def _look(self) -> None:
        while self._watchers:
            after = min(seen for queues in self._watchers.values() for seen in queues.values())
            look = partial(self._archive.runs.events_after, after, list(self._watchers))
            try:
                found = await self._archive.read(look)
            except Exception as error:  # the database may be away for a while; whoever watches stays
                _log.warning("events cannot be looked up: %s", error)
                await asyncio.sleep(RETRY)
                continue
            for number, run, data in found:
                for queue, seen in list(self._watchers.get(run, {}).items()):
                    if number > seen:
                        self._watchers[run][queue] = number
                        queue.put_nowait((number, data))
            await asyncio.sleep(LOOK)


@router.get(
    "/runs/{run}/events",
    responses={
        200: {"content": {"text/event-stream": {}}, "description": "status, stage, best, end; stopping"},
        **errors(404),
    },
    response_class=EventSourceResponse,
)
async def events(
    run: RunPath, service: Service, request: Request, last_event_id: Annotated[str, Header()] = ""
) -> EventSourceResponse:
    """Watch a run: `status`, `stage` (with fraction), `best` (seconds, duration of a verified motion), `end`.

    Of a run that has ended, what happened then. `stopping`: the server stops; come back with the `id` of the last
    event as `Last-Event-ID`, and what follows it is sent.
    """
    archive = service.archive
    record = await archive.run(run)
    feed: EventFeed = request.app.state.feed
    after = await archive.read(partial(_known, archive, run, last_event_id))

    over = record["status"] in ENDED
    then = await archive.read(partial(archive.runs.events_after, after, [run])) if over else []

    async def lines(stopping: anyio.Event) -> Lines:
        if over:
            for one, _, data in then:
                if data["type"] != "end":
                    yield _line(one, data)
            yield _line(then[-1][0] if then else None, _end(record))
            return
        if not after:
            yield _line(None, {"type": "status", "status": record["status"]})
        async for line in feed.events(run, after, stopping):
            yield _line(*line)

    return event_stream(lines)


def _known(archive: Archive, run: str, last: str) -> int:
    """The number of the last event that a client has seen; 0 where the run has no such event (any more)."""
    number = int(last) if last.isascii() and last.isdigit() and len(last) < 19 else 0
    found = archive.runs.events_after(number - 1, [run])[:1] if number else []
    return number if found and found[0][0] == number else 0


def _end(record: Record) -> dict[str, Any]:
    return {"type": "end", "status": record["status"], "verified": record["verified"]}


def _line(number: int | None, data: dict[str, Any]) -> dict[str, Any]:
    line: dict[str, Any] = {"event": data["type"], "data": json.dumps(data)}
    if number is not None:
        line["id"] = str(number)
    if data["type"] == "stopping":
        line["retry"] = int(1000 * RETRY)
    return line
