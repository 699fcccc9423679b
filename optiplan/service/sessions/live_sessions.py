"""Controllers that run for live views: started, aimed, stopped; none runs on unseen."""

import asyncio
from typing import Any

from optiplan.service.execution.solver_pool import SolverAnswer, SolverJob, SolverPool
from optiplan.service.models import LiveRequest
from optiplan.service.refusals import busy
from optiplan.service.requests import ProblemRequests
from optiplan.service.sessions.sessions import Session, Sessions, State

UNSEEN = 30.0
"""s that a controller runs on without a watcher."""


class LiveSession(Session):
    """A controller that runs.

    Attributes:
        about: `engine`, `period`, `joint_names`, `frame`.
        problem: as it was given; `request`: as processes take it.
    """

    def __init__(self, about: State, job: SolverJob) -> None:
        super().__init__(about, job)
        self.request = dict(job.request)
        self.problem: str | dict[str, Any] = self.request["problem"]
        self._unseen: float | None = None

    def aim(self, pose: list[float]) -> None:
        """Move the target to a pose (x, y, z, qx, qy, qz, qw)."""
        self.say({"target": pose})

    def unseen(self, now: float) -> bool:
        """Whether nobody has watched for too long; asked now and then, with the time in s."""
        if self._watchers or self._unseen is None:
            self._unseen = now
        return now - self._unseen > UNSEEN


class LiveSessions(Sessions[LiveSession]):
    """The controllers of a server."""

    def __init__(self, requests: ProblemRequests, pool: SolverPool, most: int) -> None:
        """Of a service with these processes; `most` may run at a time."""
        super().__init__(pool, "live", "controller")
        self._requests, self._most = requests, most
        self._starting = 0
        self._last: LiveSession | None = None

    def seen(self, session: str) -> LiveSession:
        """One that runs, or the last that ended.

        Raises:
            Refusal: it is neither.
        """
        return self._last if self._last is not None and self._last.id == session else self.get(session)

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

    def _ended(self, session: LiveSession, answer: SolverAnswer) -> None:
        """Report the end of a controller; what was seen of the last one is kept."""
        self._last = session
        super()._ended(session, answer)

    def _session(self, about: State, job: SolverJob) -> LiveSession:
        return LiveSession(about, job)

    def _look(self, session: LiveSession) -> None:
        """Stop a controller that nobody watches any more."""
        if session.unseen(asyncio.get_running_loop().time()):
            session.stop()
