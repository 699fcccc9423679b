"""Requests to solver processes: problems as data, checks of problems, digests."""

import asyncio
import hashlib
import json
import re
from collections.abc import Mapping
from typing import Any

from optiplan.cache import MostRecent
from optiplan.runs.run_folder import TRAJECTORY
from optiplan.service.archive import Archive
from optiplan.service.execution.solver_pool import Lane, SolverAnswer, SolverJob, SolverPool
from optiplan.service.models import ProblemInput, Submission
from optiplan.service.refusals import Refusal, busy, not_found
from optiplan.service.settings import ServiceSettings
from optiplan.service.store.run_table import Record
from optiplan.trajectory.trajectory import Trajectory

REMEMBERED = 2000
"""Checks kept in memory."""
TEXTS = 64
"""Texts of stored problems kept in memory."""
LOOKING = 400
"""Problems that may wait to be read."""


class ProblemRequests:
    """Turn problems into requests, and have processes answer them."""

    def __init__(self, settings: ServiceSettings, archive: Archive, pool: SolverPool) -> None:
        self._settings, self._archive, self._pool = settings, archive, pool
        self._checked: MostRecent[Mapping[str, Any]] = MostRecent(REMEMBERED)
        self._texts: MostRecent[Record] = MostRecent(TEXTS)

    async def of(self, given: ProblemInput) -> Record:
        """Return a problem as processes take it; a hash is replaced by the stored text.

        Raises:
            Refusal: it is not stored, its scene is too large, or the run that it begins at has no motion.
        """
        request = given.model_dump(include={"problem", "name", "start", "goal", "planner", "options", "seed"})
        text = given.problem if isinstance(given.problem, str) else json.dumps(given.problem)
        if re.fullmatch("[0-9a-f]{64}", text):
            stored = await self._archive.read(lambda: self._stored(text))
            request |= {key: value for key, value in stored.items() if request.get(key) is None}
            request["problem"] = stored["problem"]
        elif (count := len(re.findall(r"\bshape\b", text))) > self._settings.bodies:  # before anybody reads it all
            raise Refusal(422, f"the scene has {count} bodies; this server takes {self._settings.bodies}")
        if isinstance(given, Submission) and given.warm_start is not None:
            motion = await self._archive.content(await self._archive.run(given.warm_start), TRAJECTORY)
            request["earlier"] = await self._archive.read(lambda: Trajectory.from_dict(json.loads(motion)).to_dict())
        return request

    def _stored(self, problem: str) -> Record:
        """Return the stored problem of a hash; the last texts are kept by digest."""
        row = self._archive.problems.get(problem)
        stored = row and self._texts.find(row["text"])
        if row and not stored and (content := self._archive.contents.get(row["text"])) is not None:
            stored = self._texts.keep(row["text"], json.loads(content))
        if not stored:
            raise not_found("problem", problem)
        return stored

    async def check(self, given: ProblemInput) -> Mapping[str, Any]:
        """Check a problem; return its `hash`, `name`, `robot`, `planner`, `options`, `seed`.

        Raises:
            Refusal: it cannot be planned; holds every issue.
        """
        request = await self.of(given)
        key = digest_of(request)
        if (known := self._checked.find(key)) is not None:
            return known
        if self._pool.waiting("look") > LOOKING:
            raise busy("too many problems wait to be read", 2.0)
        about = dict((await self.ask(request, "check")).data)
        return self._checked.keep(key, about) if about.pop("lasts") else about  # files may change

    async def ask(
        self, request: Mapping[str, Any], do: str, seconds: float | None = None, lane: Lane = "look"
    ) -> SolverAnswer:
        """Have a process read, draw or compute something within `seconds`; None: those of the settings.

        Raises:
            Refusal: the request is wrong, or takes too long or too much memory.
        """
        job = SolverJob({**request, "do": do}, seconds or self._settings.reading)
        answer = await asyncio.wrap_future(self._pool.submit(lane, job))
        if answer.death in ("timeout", "out-of-memory"):
            raise Refusal(422, f"the problem cannot be read: {answer.detail}")
        if answer.death is not None:
            raise Refusal(503, f"the problem was not read: {answer.detail}", headers={"Retry-After": "1"})
        if "error" in answer.data:
            raise refusal_of(answer)
        return answer


def refusal_of(answer: SolverAnswer) -> Refusal:
    """Return the refusal for an error of a process: a wrong request (422) or a bug (500)."""
    return Refusal(500 if "bug" in answer.data else 422, answer.data["error"], answer.data["issues"])


def digest_of(value: Any) -> str:
    """Return the SHA-256, in hex, of JSON-ready data."""
    return hashlib.sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()
