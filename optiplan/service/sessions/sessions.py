"""What runs in a process of its own: started, watched by any number, spoken to, ended."""

import asyncio
import base64
import math
import uuid
from abc import ABC, abstractmethod
from array import array
from collections import deque
from collections.abc import AsyncIterator, Mapping
from typing import Any, Generic, TypeVar

import anyio

from optiplan.service.execution.solver_pool import TRANSPORT, Lane, SolverAnswer, SolverJob, SolverPool
from optiplan.service.refusals import Refusal, not_found
from optiplan.service.requests import refusal_of
from optiplan.service.streams import next_of

LOOK = 0.01
"""s between two looks for words to a process."""

State = dict[str, Any]

MOST_STATES = 15_000
"""Last states of a session that are kept: ten minutes at 25 a second."""


class SeenStates:
    """Last states of a session, to be kept as a run folder.

    Rows of t, q, v, wanted positions, and the tool's target where there is one: s, rad or m, and m.
    """

    def __init__(self) -> None:
        self._rows: deque[array[float]] = deque(maxlen=MOST_STATES)

    def add(self, state: Mapping[str, Any]) -> None:
        """Keep a state with a position and a velocity of each joint; time must go on."""
        q, v, wanted = state.get("measured") or state["q"], state["v"], state.get("wanted") or state["q"]
        if v is None or len(q) != len(v) or None in q or (self._rows and state["t"] <= self._rows[-1][0]):
            return
        self._rows.append(array("d", [state["t"], *q, *v, *wanted, *state.get("target", ())]))

    def request(self, by: str) -> dict[str, Any] | None:
        """Return what a process needs for the folder, beside the problem; None where less than two states came."""
        if len(self._rows) < 2:
            return None
        rows = base64.b64encode(b"".join(row.tobytes() for row in self._rows)).decode()
        return {"rows": rows, "columns": len(self._rows[0]), "by": by}


class Session:
    """Something that runs.

    Attributes:
        id: of the session.
        about: what is reported of it before it begins.
        seen: its last states.
    """

    def __init__(self, about: State, job: SolverJob) -> None:
        self.id, self.about, self.seen = uuid.uuid4().hex, about, SeenStates()
        self._end: State = {}
        self._job = job
        self._watchers: set[asyncio.Queue[State]] = set()

    @property
    def ended(self) -> str | None:
        """Why it has ended; None while it runs."""
        return self._end.get("reason")

    def say(self, words: Mapping[str, Any]) -> None:
        """Say something to the process."""
        self._job.said.put(words)

    def stop(self) -> None:
        """End it."""
        self.say({"stop": True})

    def take(self, message: State) -> None:
        """Take a message of the process: a state, which is kept and all watchers see."""
        self.seen.add(message)
        self.publish({"type": "state", **message})

    def publish(self, event: State) -> None:
        """Hand an event to all watchers; a slow one misses the oldest, never the last. Later ones get the end."""
        if event["type"] == "end":
            self._end = event
        for queue in self._watchers:
            if queue.full():
                queue.get_nowait()
            queue.put_nowait(event)

    async def events(self, stopping: anyio.Event) -> AsyncIterator[State]:
        """States as they come, until it has ended or the server stops."""
        if self._end:
            yield self._end
            return
        queue: asyncio.Queue[State] = asyncio.Queue(4)
        self._watchers.add(queue)
        try:
            while True:
                event = await next_of(queue, stopping) or {"type": "end", "reason": "the server stops"}
                yield event
                if event["type"] == "end":
                    return
        finally:
            self._watchers.discard(queue)


Kind = TypeVar("Kind", bound=Session)


class Sessions(ABC, Generic[Kind]):
    """The sessions of one kind on a server.

    Args:
        pool: its processes.
        lane: of this kind.
        called: what one is called in an error.
    """

    def __init__(self, pool: SolverPool, lane: Lane, called: str) -> None:
        self._pool, self._lane, self._called = pool, lane, called
        self._running: dict[str, Kind] = {}
        self._tasks: set[asyncio.Task[None]] = set()

    @abstractmethod
    def _session(self, about: State, job: SolverJob) -> Kind:
        """Return the session of a process that has begun."""

    @abstractmethod
    def _look(self, session: Kind) -> None:
        """Look after a session, once a second."""

    def all(self) -> list[Kind]:
        """Those that run."""
        return list(self._running.values())

    def get(self, session: str) -> Kind:
        """One that runs.

        Raises:
            Refusal: it has ended, or never was.
        """
        if session not in self._running:
            raise not_found(f"{self._called} that runs under", session)
        return self._running[session]

    async def _begin(self, request: State) -> Kind:
        """Have a process begin, which runs until it is stopped; return once it runs.

        Raises:
            Refusal: it does not begin.
        """
        loop = asyncio.get_running_loop()
        session: Kind | None = None

        def told(message: Any) -> None:
            content = {key: value for key, value in message.items() if key not in TRANSPORT}
            if session is not None:
                loop.call_soon_threadsafe(session.take, content)

        job = SolverJob(request, math.inf, told=told, look=LOOK)
        begun, whole = self._pool.submit_early(self._lane, job)
        try:
            await asyncio.wait([begun, whole], return_when=asyncio.FIRST_COMPLETED)
        except asyncio.CancelledError:  # the caller has gone
            job.cancel.set()
            raise
        if not begun.done():
            answer = whole.result()
            if answer.death is not None:
                why = f"the {self._called} did not start: {answer.detail}"
                raise Refusal(503, why, headers={"Retry-After": "1"})
            raise refusal_of(answer)
        session = self._session(dict(begun.result().data), job)
        self._running[session.id] = session
        task = asyncio.ensure_future(self._attend(session, whole))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return session

    async def _attend(self, session: Kind, whole: "asyncio.Future[SolverAnswer]") -> None:
        """Look after a session while it runs, and report its end."""
        while not whole.done():
            await asyncio.wait([whole], timeout=1.0)
            self._look(session)
        del self._running[session.id]
        self._ended(session, whole.result())

    def _ended(self, session: Kind, answer: SolverAnswer) -> None:
        """Report the end of a session to its watchers."""
        why = "stopped" if answer.death is None else f"{answer.death}: {answer.detail}"
        session.publish({"type": "end", "reason": str(answer.data.get("error", why))})
