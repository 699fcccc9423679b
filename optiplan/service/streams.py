"""Streams of server-sent events: kept alive while nothing happens, ended with an event when the server stops."""

import asyncio
from collections.abc import AsyncIterator, Callable
from typing import Any, TypeVar

import anyio
from sse_starlette.sse import EventSourceResponse

BEAT = 15
"""s between two signs of life on a quiet line."""
FAREWELL = 1.0
"""s that a stream has for its last event when the server stops."""

Item = TypeVar("Item")

Lines = AsyncIterator[dict[str, Any]]


def event_stream(lines: Callable[[anyio.Event], Lines]) -> EventSourceResponse:
    """The answer with the events of `lines`, which is given the event that is set when the server stops."""
    stopping = anyio.Event()
    return EventSourceResponse(lines(stopping), ping=BEAT, shutdown_event=stopping, shutdown_grace_period=FAREWELL)


async def next_of(queue: "asyncio.Queue[Item]", stopping: anyio.Event, patience: float | None = None) -> Item | None:
    """The next item of a queue; None where none comes within this time, s, or before the server stops."""
    news, stop = asyncio.ensure_future(queue.get()), asyncio.ensure_future(stopping.wait())
    try:
        await asyncio.wait((news, stop), timeout=patience, return_when=asyncio.FIRST_COMPLETED)
        return news.result() if news.done() else None
    finally:
        news.cancel()
        stop.cancel()
