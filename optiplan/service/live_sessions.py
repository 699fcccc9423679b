"""Controllers that run for live views: started, watched by any number, aimed, stopped; none runs on unseen."""

import asyncio
import uuid
from collections.abc import AsyncIterator
from contextlib import suppress
from typing import Any

import anyio

from optiplan.service.execution.solver_pool import SolverAnswer, SolverJob, SolverPool
from optiplan.service.models import LiveRequest
from optiplan.service.refusals import Refusal, busy, not_found
from optiplan.service.requests import ProblemRequests, refusal_of
from optiplan.service.streams import next_of

UNSEEN = 30.0
"""s that a controller runs on without a watcher."""
LONGEST = 3600.0
"""s that one runs at all."""

State = dict[str, Any]


class LiveSession:
    """A controller that runs.

    Attributes:
        id: of the session.
        about: `engine`, `period`, `joint_names`, `frame`.
        problem: as it was given.
    """

    def __init__(self, about: State, job: SolverJob) -> None:
        self.id, self.about = uuid.uuid4().hex, about
        self.problem: str | State = job.request["problem"]
        self._job = job
        self._watchers: set[asyncio.Queue[State]] = set()
        self._unseen: float | None = None

    def aim(self, pose: list[float]) -> None:
        """Move the target to a pose (x, y, z, qx, qy, qz, qw)."""
        self._job.said.put({"target": pose})

    def stop(self) -> None:
        """End it."""
        self._job.said.put({"stop": True})

    def publish(self, event: State) -> None:
        """Hand an event to all watchers; of states, one that is slow sees the newest alone."""
        for queue in self._watchers:
            if event["type"] == "state" and queue.full():
                with suppress(asyncio.QueueEmpty):
                    queue.get_nowait()
            with suppress(asyncio.QueueFull):
                queue.put_nowait(event)

    def unseen(self, now: float) -> bool:
        """Whether nobody has watched for too long; asked now and then, with the time in s."""
        if self._watchers or self._unseen is None:
            self._unseen = now
        return now - self._unseen > UNSEEN

    async def events(self, stopping: anyio.Event) -> AsyncIterator[State]:
        """States as they come, until it has ended or the server stops."""
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


class LiveSessions:
    """The controllers of a server."""

    def __init__(self, requests: ProblemRequests, pool: SolverPool, most: int) -> None:
        """Of a service with these processes; `most` may run at a time."""
        self._requests, self._pool, self._most = requests, pool, most
        self._running: dict[str, LiveSession] = {}
        self._starting = 0
        self._tasks: set[asyncio.Task[None]] = set()

    def all(self) -> list[LiveSession]:
        """Those that run."""
        return list(self._running.values())

    def get(self, session: str) -> LiveSession:
        """One that runs.

        Raises:
            Refusal: it has ended, or never was.
        """
        if session not in self._running:
            raise not_found("controller that runs under", session)
        return self._running[session]

    async def start(self, given: LiveRequest) -> LiveSession:
        """Start a controller at a problem's start.

        Raises:
            Refusal: the problem is wrong, or as many run as may.
        """
        request = await self._requests.of(given)
        if len(self._running) + self._starting >= self._most:
            raise busy(f"{self._most} controllers may run at a time on this server, and do", 10.0)
        self._starting += 1
        try:
            await self._requests.check(given)
            return await self._begin({**request, "do": "live", "engine": given.engine})
        finally:
            self._starting -= 1

    async def _begin(self, request: State) -> LiveSession:
        loop = asyncio.get_running_loop()
        begun: asyncio.Future[SolverAnswer] = loop.create_future()
        session: LiveSession | None = None

        def told(message: Any) -> None:
            state = {key: value for key, value in message.items() if key not in ("phase", "sizes", "blob")}
            if session is not None:
                loop.call_soon_threadsafe(session.publish, {"type": "state", **state})

        def answered(answer: SolverAnswer) -> None:
            loop.call_soon_threadsafe(begun.set_result, answer)

        job = SolverJob(request, LONGEST, told=told, answered=answered)
        whole = asyncio.wrap_future(self._pool.submit("live", job))
        try:
            await asyncio.wait([begun, whole], return_when=asyncio.FIRST_COMPLETED)
        except asyncio.CancelledError:  # the caller has gone
            job.cancel.set()
            raise
        if not begun.done():
            answer = whole.result()
            if answer.death is not None:
                raise Refusal(503, f"the controller did not start: {answer.detail}", headers={"Retry-After": "1"})
            raise refusal_of(answer)
        session = LiveSession(dict(begun.result().data), job)
        self._running[session.id] = session
        task = asyncio.ensure_future(self._attend(session, whole))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return session

    async def _attend(self, session: LiveSession, whole: "asyncio.Future[SolverAnswer]") -> None:
        """Stop a controller that nobody watches any more, and tell watchers of the end of one."""
        now = asyncio.get_running_loop().time
        while not whole.done():
            await asyncio.wait([whole], timeout=1.0)
            if session.unseen(now()):
                session.stop()
        del self._running[session.id]
        answer = whole.result()
        why = "stopped" if answer.death is None else f"{answer.death}: {answer.detail}"
        session.publish({"type": "end", "reason": str(answer.data.get("error", why))})
