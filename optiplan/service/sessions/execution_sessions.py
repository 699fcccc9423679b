"""Motions that are executed, one at a time by each driver, and how each ended.

An execution goes on without watchers. A client may hold a lease: where it is not renewed in time, the robot stops. The
process that moves the robot stops it also where the line to the server ends.
"""

import asyncio
import itertools
import json
import logging
import time
from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any

from optiplan.bench.execution.keeper import RESPITE
from optiplan.config.messages import choices
from optiplan.service.archive import Archive
from optiplan.service.execution.solver_pool import SolverAnswer, SolverJob, SolverPool
from optiplan.service.execution_models import ExecutionRequest, MotionInput
from optiplan.service.models import PlanRequest, ProblemInput
from optiplan.service.refusals import Refusal, not_found
from optiplan.service.requests import ProblemRequests
from optiplan.service.sessions.sessions import Session, Sessions, State
from optiplan.service.settings import DriverSetup
from optiplan.service.waited_plans import WaitedPlans

SILENT = 1.0
"""s without a state after which a process counts as silent; after `LOST` s it is ended."""
LOST = 4.0
ANSWER = 5.0
"""s that a process has for an answer; a motion that is to take over is verified first, in `PROOF` s."""
PROOF = 60.0
KEPT = 32
"""Executions that are remembered after their end."""

_log = logging.getLogger("optiplan.service")


class ExecutionSession(Session):
    """A motion that is executed.

    Attributes:
        about: what `ExecutionAnswer` lists, apart from how it ended.
        motions: requests for the problem and the motion, first that which it began with, then those that took over.
        state: the last one; None before the first.
        clean: whether it ended with the robot at rest, as was asked.
    """

    def __init__(self, about: State, job: SolverJob) -> None:
        super().__init__(about, job)
        self.motions: list[State] = [dict(job.request)]
        self.state: State | None = None
        self.clean: bool | None = None
        self.heard = time.monotonic()
        self._questions: dict[int, asyncio.Future[State]] = {}
        self._offered: dict[int, State] = {}  # motions that may take over, by the number of the question
        self._numbers = itertools.count(1)

    def take(self, message: State) -> None:
        """Take a message: a state, or the answer to a question."""
        self.heard = time.monotonic()
        if "reply" in message:
            number = message.pop("reply")
            offered, waiting = self._offered.pop(number, None), self._questions.pop(number, None)
            if offered is not None and message.get("taken"):  # also after its caller has given up
                self.motions.append(offered)
            if waiting is not None and not waiting.done():
                waiting.set_result(message)
        else:
            self.state = message["state"]
            super().take(message["state"])

    async def ask(self, what: str, seconds: float = ANSWER, **given: Any) -> State:
        """Say something, and return the answer.

        Raises:
            Refusal: it has ended, or does not answer.
        """
        if self.ended is not None:
            raise Refusal(409, f"the execution '{self.id}' has ended: {self.ended}")
        number = next(self._numbers)
        waiting: asyncio.Future[State] = asyncio.get_running_loop().create_future()
        self._questions[number] = waiting
        if what == "splice":
            self._offered[number] = given["request"]
        self.say({"do": what, "number": number, **given})
        try:
            answer = await asyncio.wait_for(waiting, seconds)
        except TimeoutError:
            raise Refusal(503, f"the execution '{self.id}' did not answer within {seconds:g} s") from None
        finally:
            self._questions.pop(number, None)
        if "error" in answer:
            raise Refusal(int(answer.get("status", 422)), answer["error"], answer.get("issues", ()))
        return answer

    @property
    def motion(self) -> State:
        """The request for the motion that is executed now."""
        number: int = (self.state or {}).get("motion", 0)
        return self.motions[min(number, len(self.motions) - 1)]  # the state may come just before the answer

    @property
    def silent(self) -> float:
        """How long nothing has come from its process, s; 0 where that is as it should be."""
        passed = time.monotonic() - self.heard
        return passed if self.ended is None and passed > SILENT else 0.0

    def give_up(self) -> None:
        """End a process that says nothing any more; with its line closed it stops the robot, if it can."""
        self._job.cancel.set()

    def end(self, reason: str, clean: bool) -> None:
        """Remember the end, and report it to all who watch or wait for an answer."""
        self.clean = clean
        for waiting in self._questions.values():
            if not waiting.done():
                waiting.set_result({"error": f"the execution '{self.id}' has ended: {reason}", "status": 409})
        self.publish({"type": "end", "reason": reason, "clean": clean})


class ExecutionSessions(Sessions[ExecutionSession]):
    """The executions of a server.

    Args:
        requests: problems as processes take them.
        archive: of runs.
        plans: of problems that are to be planned first.
        pool: the processes.
        drivers: robots that this server may move.
    """

    def __init__(
        self,
        requests: ProblemRequests,
        archive: Archive,
        plans: WaitedPlans,
        pool: SolverPool,
        drivers: Sequence[DriverSetup],
    ) -> None:
        super().__init__(pool, "execution", "execution")
        self._requests, self._archive, self._plans = requests, archive, plans
        self.drivers = {one.name: one for one in drivers}
        self._reserved: set[str] = set()
        self._past: deque[ExecutionSession] = deque(maxlen=KEPT)
        self.unclean = 0

    def all(self) -> list[ExecutionSession]:
        """Those that run, then the last that ended."""
        return [*super().all(), *self._past]

    def get(self, session: str) -> ExecutionSession:
        """One that runs, or has ended not long ago.

        Raises:
            Refusal: there is none.
        """
        found = next((one for one in self.all() if one.id == session), None)
        if found is None:
            raise not_found("execution", session)
        return found

    @property
    def running(self) -> int:
        """How many run."""
        return len(self._running)

    def faults(self) -> list[str]:
        """Which executions are silent."""
        return [
            f"nothing has come from the execution {one.id} on '{one.about['driver']}' for {one.silent:.1f} s"
            for one in super().all()
            if one.silent
        ]

    async def start(self, given: ExecutionRequest) -> ExecutionSession:
        """Start the execution of a verified motion.

        Raises:
            Refusal: there is no such driver (422) or motion (404), the driver is in use (409), the motion is not
                verified, or the driver cannot be reached (422).
        """
        if given.driver not in self.drivers:
            found, expected = f"'{given.driver}'", choices(given.driver, list(self.drivers))
            issue = {"file": "request", "line": None, "field": "body.driver", "found": found, "expected": expected}
            raise Refusal(422, f"body.driver: found {found}; expected {expected}", [issue])
        setup = self.drivers[given.driver]
        self._check_free(given.driver)
        self._reserved.add(given.driver)
        try:
            run, motion = await self.motion(given)
            asked = given.model_dump(include=_STEERING)
            asked["patience"] = given.patience or setup.patience
            asked |= {"run": run, "robot": given.driver, "driver": setup.driver, "driver_options": dict(setup.options)}
            return await self._begin({**motion, **asked, "do": "execute"})
        finally:
            self._reserved.discard(given.driver)

    async def motion(self, given: MotionInput) -> tuple[str | None, State]:
        """Return the id of a run, if it is stored here, and the request for its problem and motion.

        Raises:
            Refusal: there is no such motion, or it is not verified.
        """
        if given.execution is not None:
            earlier = self.get(given.execution)
            return earlier.about["run"], {key: earlier.motions[0].get(key) for key in _MOTION}
        if given.run is not None:
            record = await self._archive.run(given.run)
            if not record["verified"]:
                raise Refusal(409, f"the run '{given.run}' has no verified motion: it is {record['status']}")
            return given.run, await self._archive.motion_request(record)
        problem = ProblemInput(problem=given.problem or "", name=given.name, start=None, goal=None)
        if given.trajectory is not None:
            return None, {**await self._requests.of(problem), "motion": json.dumps(given.trajectory)}
        asked = PlanRequest(**problem.model_dump(), **given.model_dump(include=set(PlanRequest.model_fields) - _OWN))
        planned = await self._plans.plan(asked, _stays)
        await planned.keep()
        if planned.motion is None or not planned.record["verified"]:
            failure = planned.record.get("failure") or {"kind": "not verified", "detail": "the motion breaks a limit"}
            raise Refusal(422, f"no verified motion was found: {failure['kind']}: {failure['detail']}")
        return planned.record["id"], {**await self._requests.of(asked), "motion": planned.motion.decode()}

    async def finish(self) -> None:
        """Stop all robots, and wait until they stand still."""
        for session in super().all():
            session.say({"do": "stop", "number": 0, "reason": "the server stops"})
        if self._tasks:
            await asyncio.wait(self._tasks, timeout=RESPITE)

    def _check_free(self, driver: str) -> None:
        holder = next((one for one in super().all() if one.about["driver"] == driver), None)
        if holder is not None or driver in self._reserved:
            who = f"the execution {holder.id}" if holder else "an execution that starts"
            raise Refusal(409, f"the driver '{driver}' is in use by {who}; stop that first")

    def _session(self, about: State, job: SolverJob) -> ExecutionSession:
        asked = job.request
        return ExecutionSession(about | {"run": asked["run"], "driver": asked["robot"], "lease": asked["lease"]}, job)

    def _look(self, session: ExecutionSession) -> None:
        if session.silent > LOST:
            session.give_up()

    def _ended(self, session: ExecutionSession, answer: SolverAnswer) -> None:
        reason, clean = _end_of(answer, session.silent)
        if not clean:
            self.unclean += 1
            _log.error("the execution %s on '%s' ended: %s", session.id, session.about["driver"], reason)
        self._past.appendleft(session)
        session.end(reason, clean)


async def _stays() -> bool:
    """A caller that stays."""
    return False


def _end_of(answer: SolverAnswer, silent: float) -> tuple[str, bool]:
    """Return why an execution ended, and whether the robot stands still as was asked."""
    data: Mapping[str, Any] = answer.data
    if answer.death is not None:
        why = f"its process said nothing for {silent:.1f} s" if silent else f"its process ended: {answer.death}"
        return f"{why}: {answer.detail}; the driver stops the robot by itself", False
    if "error" in data:
        return str(data["error"]), False
    return str(data["reason"]), bool(data["clean"])


_STEERING = {"override", "clearance", "deviation", "paused", "rate", "patience", "lease"}
"""Fields of a request that its process needs."""
_MOTION = ("problem", "name", "start", "goal", "motion")
"""Keys of a request that say what is executed."""
_OWN = {"problem", "name", "start", "goal", "rate"}
"""Fields of a plan that an execution does not have."""
