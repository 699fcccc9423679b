"""What a server does with runs, apart from HTTP: checks and submits problems, hands out what came of them."""

import asyncio
import json
import logging
import re
from collections import OrderedDict
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

import optiplan
from optiplan.runs.run_folder import RUN, TRAJECTORY
from optiplan.service.execution.event_writer import EventWriter
from optiplan.service.execution.run_queue import RunQueue
from optiplan.service.execution.run_solver import RunSolver
from optiplan.service.execution.solver_pool import Lane, SolverAnswer, SolverJob, SolverPool
from optiplan.service.health import HealthCheck
from optiplan.service.models import ProblemInput, Submission
from optiplan.service.refusals import Refusal, busy, not_found
from optiplan.service.requests import digest_of, names_files, refusal_of
from optiplan.service.settings import ServiceSettings
from optiplan.service.store.contents import ContentFolder
from optiplan.service.store.problem_table import ProblemTable
from optiplan.service.store.retention import outdated, sweep
from optiplan.service.store.run_table import NewRun, Record, RunTable
from optiplan.service.store.tables import open_database, store_name
from optiplan.service.store.uploads import Uploads
from optiplan.service.store.write_probe import WriteProbe
from optiplan.service.watchdog import feed_watchdog
from optiplan.trajectory.trajectory import Trajectory

Result = TypeVar("Result")

_log = logging.getLogger("optiplan.service")

REMEMBERED = 2000
"""Checks of problems that are remembered."""
TEXTS = 64
"""Stored problems whose texts are kept in memory."""
LOOKING = 400
"""Problems that may wait to be read."""
WRITERS, READERS = 4, 8
"""Threads that write to the database, and that read from it."""


class RunService:
    """Takes problems, has them solved, and finds the runs again: tables, contents, processes and the queue.

    Attributes:
        settings: what it was made with.
        engine: of the database.
        runs: the table of runs.
        problems: the table of stored problems.
        contents: the folder of contents.
        uploads: the folder of uploaded files.
        pool: the solver processes.
        queue: the durable queue.
        solver: solves queued runs.
        health: says whether this process can work.
    """

    def __init__(self, settings: ServiceSettings, serving: bool = True) -> None:
        """Open the database and the folder; nothing is started.

        Args:
            settings: of the process.
            serving: whether callers wait for it; else it only takes runs from the queue.

        Raises:
            OptiPlanError: one of them cannot be used.
        """
        self.settings = settings
        self.contents = ContentFolder(settings.data / "contents", settings.spare)
        self.uploads = Uploads(settings.upload_folder, settings.uploads, settings.upload_files)
        self.engine = open_database(settings.database_url)
        self.contents.claim(store_name(self.engine))
        self.runs, self.problems = RunTable(self.engine), ProblemTable(self.engine)
        callers: dict[Lane, int] = {"plan": settings.interactive, "look": 1, "live": settings.live} if serving else {}
        self.pool = SolverPool(settings, {**callers, "queue": settings.solvers})
        events = EventWriter(self.runs)
        self.solver = RunSolver(settings, events, self.contents, self.pool)
        self.queue = RunQueue(settings, self.engine, self.runs, events, self.solver)
        self.health = HealthCheck(self.pool, self.queue, WriteProbe(self.engine), self.contents)
        self._checked: OrderedDict[str, Mapping[str, Any]] = OrderedDict()
        self._texts: OrderedDict[str, Record] = OrderedDict()
        self._writers = ThreadPoolExecutor(WRITERS, "write")
        self._readers = ThreadPoolExecutor(READERS, "read")

    def start(self) -> None:
        """Start queue and processes, these last: their warming up takes the processor for seconds."""
        self.queue.start()
        self.pool.start()
        self._watchdog = feed_watchdog(lambda: self.health.living()[0] == 200)

    def close(self) -> None:
        """Stop all that was started; runs under way are put back."""
        self.queue.close()
        self.pool.close()
        self._watchdog.set()
        self._writers.shutdown()
        self._readers.shutdown()
        self.engine.dispose()

    async def check(self, given: ProblemInput) -> Mapping[str, Any]:
        """What a problem is: `hash`, `name`, `robot`, `planner`, `options`, `seed`.

        Raises:
            Refusal: it cannot be planned; every issue is told.
        """
        request = await self.request(given)
        key = digest_of(request)
        if key in self._checked:
            self._checked.move_to_end(key)
            return self._checked[key]
        if self.pool.waiting("look") > LOOKING:
            raise busy("too many problems wait to be read", 2.0)
        answer = await self.ask(request, "check")
        if not names_files(request):  # files may change
            self._checked[key] = answer.data
            if len(self._checked) > REMEMBERED:
                self._checked.popitem(last=False)
        return answer.data

    async def submit(self, submission: Submission, name: str) -> Record:
        """Queue a run and return it, or the one that there is of the same submission.

        Args:
            submission: what to plan.
            name: of who wants it, for `queue.cancel`.

        Raises:
            Refusal: the problem cannot be planned, the queue is full.
            StorageFullError: so is the disk.
        """
        self.check_budget(submission)
        about = await self.check(submission)
        request = await self.request(submission)
        return await self.write(lambda: self._submit(submission, name, about, request))

    def _submit(self, submission: Submission, name: str, about: Mapping[str, Any], request: Record) -> Record:
        self.contents.check_room()
        new = self.new_run(submission, about, "")
        known = self.runs.get(new.id)
        if known is not None and known["status"] == "done":
            return known
        waits = known is not None and known["status"] in ("queued", "running")
        if not waits and (waiting := self.runs.waiting()) >= self.settings.queue:
            raise busy(f"{waiting} runs are queued, which is all that this server takes", min(60.0, 0.1 * waiting))
        new = self.new_run(submission, about, self.contents.put(json.dumps(request).encode()))
        record, fresh = self.runs.submit(new, name)
        if fresh:
            self.queue.enqueue(new.id)
        return record

    async def run(self, run: str) -> Record:
        """A run.

        Raises:
            Refusal: there is none of that id.
        """
        record = await self.read(lambda: self.runs.get(run))
        if record is None:
            raise not_found("run", run)
        return record

    async def content(self, record: Record, name: str) -> bytes:
        """A file of a run.

        Raises:
            Refusal: the run has none of that name, yet or at all.
        """
        digest = (record["contents"] or {}).get(name)
        content = None if digest is None else await self.read(lambda: self.contents.get(digest))
        if content is None:
            raise Refusal(404, f"the run '{record['id']}' is {record['status']} and has no {name}")
        return content

    async def stored_request(self, record: Record) -> Record:
        """The problem of a run as processes take it.

        Raises:
            Refusal: its content is gone.
        """
        stored = await self.read(lambda: self.contents.get(record["request"]))
        if stored is None:
            raise Refusal(404, f"the problem of the run '{record['id']}' is not in the folder of contents")
        found: Record = json.loads(stored)
        return found

    async def page(self, *records: Record) -> bytes:
        """The page of one run that has ended, or of several of one problem.

        Raises:
            Refusal: one has no record, or they are of different problems.
        """
        if len({record["problem"] for record in records}) > 1:
            raise Refusal(422, "these runs are of different problems; expected runs of one")
        shown = []
        for record in records:
            motion = await self.content(record, TRAJECTORY) if TRAJECTORY in (record["contents"] or {}) else b""
            shown.append({"run": (await self.content(record, RUN)).decode(), "trajectory": motion.decode()})
        answer = await self.ask({**await self.stored_request(records[0]), "runs": shown}, "page")
        return answer.files["page.html"]

    async def ask(self, request: Mapping[str, Any], do: str, seconds: float | None = None) -> SolverAnswer:
        """Have a process read, draw or compute something, in so many seconds; None: those of the settings.

        Raises:
            Refusal: what is asked is wrong, or takes too long or too much memory.
        """
        job = SolverJob({**request, "do": do}, seconds or self.settings.reading)
        answer = await asyncio.wrap_future(self.pool.submit("look", job))
        if answer.death in ("timeout", "out-of-memory"):
            raise Refusal(422, f"the problem cannot be read: {answer.detail}")
        if answer.death is not None:
            raise Refusal(503, f"the problem was not read: {answer.detail}", headers={"Retry-After": "1"})
        if "error" in answer.data:
            raise refusal_of(answer)
        return answer

    def forget(self, run: str) -> None:
        """Delete a run that has ended."""
        if self.runs.delete(run) is not None:
            self.queue.forget(run)

    def tidy(self) -> None:
        """Delete runs and uploads that are too old or too much, and contents that nothing refers to."""
        for run in outdated(self.runs, self.settings):
            self.forget(run)
        sweep(self.contents, self.runs, self.problems)
        self.uploads.sweep(self.settings.keep_days)

    async def read(self, look: Callable[[], Result]) -> Result:
        """Look something up in a thread for that."""
        return await asyncio.get_running_loop().run_in_executor(self._readers, look)

    async def write(self, change: Callable[[], Result]) -> Result:
        """Change something in a thread for that."""
        return await asyncio.get_running_loop().run_in_executor(self._writers, change)

    async def request(self, given: ProblemInput) -> Record:
        """A problem as processes take it: a stored one by its text.

        Raises:
            Refusal: it is not stored, its scene is too large, or the run that it begins at has no motion.
        """
        request = given.model_dump(include={"problem", "name", "start", "goal", "planner", "options", "seed"})
        text = given.problem if isinstance(given.problem, str) else json.dumps(given.problem)
        if re.fullmatch("[0-9a-f]{64}", text):
            stored = await self._stored(text)
            request |= {key: value for key, value in stored.items() if request.get(key) is None}
            request["problem"] = stored["problem"]
        elif (count := len(re.findall(r"\bshape\b", text))) > self.settings.bodies:  # before anybody reads it all
            raise Refusal(422, f"the scene has {count} bodies; this server takes {self.settings.bodies}")
        if isinstance(given, Submission) and given.warm_start is not None:
            motion = await self.content(await self.run(given.warm_start), TRAJECTORY)
            request["earlier"] = await self.read(lambda: Trajectory.from_dict(json.loads(motion)).to_dict())
        return request

    async def _stored(self, problem: str) -> Record:
        """What a hash stands for; the contents of the last ones are remembered, which are named by their digests."""
        row = await self.read(lambda: self.problems.get(problem))
        if row is None:
            raise not_found("problem", problem)
        digest = row["text"]
        if digest not in self._texts:
            content = await self.read(lambda: self.contents.get(digest))
            if content is None:
                raise not_found("problem", problem)
            self._texts[digest] = json.loads(content)
            if len(self._texts) > TEXTS:
                self._texts.popitem(last=False)
        return self._texts[digest]

    def check_budget(self, submission: Submission) -> None:
        """Raise a `Refusal` if the budget is larger than this server allows."""
        most = self.settings.most_budget
        if submission.budget > most:
            raise Refusal(422, f"budget: found {submission.budget:g} s; expected at most {most:g} s on this server")

    def new_run(self, submission: Submission, about: Mapping[str, Any], request: str) -> NewRun:
        """The run of a submission; its id is the digest of all that decides the answer."""
        asked = [about[key] for key in ("hash", "planner", "options", "seed")]
        asked += [submission.budget, submission.deadline, optiplan.__version__]
        asked += [submission.warm_start] if submission.warm_start else []
        return NewRun(
            id=digest_of(asked)[:32],
            name=about["name"],
            problem=about["hash"],
            robot=about["robot"],
            request=request,
            planner=about["planner"],
            seed=about["seed"],
            budget=submission.budget,
            deadline=submission.deadline,
        )
