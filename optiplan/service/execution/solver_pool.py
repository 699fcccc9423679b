"""Warm solver processes, a thread each: jobs in, futures out; a process over a limit of time or memory is killed."""

import asyncio
import logging
import math
import queue
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future
from contextlib import contextmanager, suppress
from dataclasses import field
from typing import Any, Literal

from optiplan.bench.execution import machine
from optiplan.bench.execution.worker_process import WorkerProcess
from optiplan.records import dataclass
from optiplan.service.settings import ServiceSettings

MODULE = "optiplan.service.execution.solver"
POLL = 0.05
"""s between two looks at the clock and at a process's memory, while it has a job."""
LOOK = 0.5
"""s between two looks at a process without a job: whether it lives."""
START = 120.0
"""s within which a process has to be ready."""
RESPITE = 1.0
"""s before a slot that failed takes the next job."""
STUCK = 60.0
"""s without a look at the clock after which a slot counts as dead."""
CLOSING = 15.0
"""s that all slots together have to end."""
SPOILT_BY = 0.75
"""Share of the allowed memory above which a process is exchanged once its job is done."""

_log = logging.getLogger("optiplan.service")

Lane = Literal["queue", "plan", "look", "report", "live", "execution"]
"""Who waits: the queue; who wants a plan; a problem read or drawn; the report of a bench; a live view; an execution."""

NICE: dict[Lane, int] = {"queue": 5, "plan": 0, "look": 1, "report": 2, "live": 0, "execution": 0}
"""How far processes step back: the server itself, then callers who wait, come before the queue."""

AT_NEED: tuple[Lane, ...] = ("report", "live", "execution")
"""Lanes whose processes are started for the first job."""

ONE_JOB: tuple[Lane, ...] = ("report", "live")
"""Lanes whose processes end with their job."""

WARM_UP: dict[Lane, str] = {"report": "", "execution": "execute"}
"""What the processes of a lane load before their first job; of others: what `plan` needs."""

MODULES: dict[Lane, str] = {"execution": "optiplan.service.execution.executing_solver"}
"""Lanes whose processes run another module than `MODULE`."""


@dataclass(frozen=True)
class SolverAnswer:
    """What a process answered.

    Attributes:
        data: JSON-ready; `error` in it says that the request was wrong, `bug` beside it that we are, `memory` that it
            takes too much of it.
        files: contents by name.
        death: why there is no answer: `timeout`, `out-of-memory`, `crashed` or `cancelled`; with `detail`.
    """

    data: Mapping[str, Any] = field(default_factory=dict)
    files: Mapping[str, bytes] = field(default_factory=dict)
    death: str | None = None
    detail: str = ""


@dataclass(eq=False)
class SolverJob:
    """One request to a process.

    Attributes:
        wall: seconds that it may take once a process has it.
        until: instant of `time.monotonic` at which it ends wherever it is.
        told: called with each message on the way.
        answered: called with what the caller waits for, where the request is `early`, before the job is done.
        said: words for a task that listens while it runs.
        look: s between two looks for such words.
        cancel: ends it at once.
    """

    request: Mapping[str, Any]
    wall: float
    until: float = math.inf
    told: Callable[[Mapping[str, Any]], None] = lambda message: None
    answered: Callable[[SolverAnswer], None] = lambda answer: None
    said: "queue.SimpleQueue[Mapping[str, Any]]" = field(default_factory=queue.SimpleQueue)
    look: float = POLL
    cancel: threading.Event = field(default_factory=threading.Event)
    future: "Future[SolverAnswer]" = field(default_factory=Future)

    def too_late(self) -> SolverAnswer | None:
        """Return the answer to a job that is not to be begun any more; None where it is."""
        if self.cancel.is_set():
            return SolverAnswer(death="cancelled", detail="cancelled before it began")
        if time.monotonic() >= self.until:
            return SolverAnswer(death="timeout", detail="its deadline passed before it began")
        return None


class SolverPool:
    """Processes by lane, ready before they are needed."""

    def __init__(self, settings: ServiceSettings, lanes: Mapping[Lane, int]) -> None:
        self._stop = threading.Event()
        self._jobs: dict[Lane, queue.Queue[SolverJob | None]] = {lane: queue.Queue() for lane in lanes}
        self._slots = [
            _Slot(settings, lane, self._jobs[lane], self._stop) for lane in lanes for _ in range(lanes[lane])
        ]

    def start(self) -> None:
        """Start all processes, without waiting for them."""
        for slot in self._slots:
            slot.thread.start()

    def submit(self, lane: Lane, job: SolverJob) -> "Future[SolverAnswer]":
        """Have a job done by the next free process of a lane."""
        self._jobs[lane].put(job)
        return job.future

    def submit_early(
        self, lane: Lane, job: SolverJob
    ) -> "tuple[asyncio.Future[SolverAnswer], asyncio.Future[SolverAnswer]]":
        """Have a job done, in an event loop; return what its caller waits for, and the whole answer, which is later."""
        loop = asyncio.get_running_loop()
        early: asyncio.Future[SolverAnswer] = loop.create_future()

        def answered(answer: SolverAnswer) -> None:
            loop.call_soon_threadsafe(early.set_result, answer)

        job.answered = answered
        return early, asyncio.wrap_future(self.submit(lane, job))

    @property
    def ready(self) -> bool:
        """Whether each process is ready, or at work, and the thread that serves it lives."""
        return not self.ended and all(slot.warm for slot in self._slots)

    @property
    def ended(self) -> list[str]:
        """Names of the threads that have ended, or hang."""
        return [slot.thread.name for slot in self._slots if not slot.serves]

    def waiting(self, lane: Lane) -> int:
        """How many jobs of a lane no process has begun."""
        return self._jobs[lane].qsize()

    def memory(self) -> float:
        """Resident memory of all processes, MB."""
        return sum(slot.memory() for slot in self._slots)

    def close(self) -> None:
        """End all processes, whatever they are doing."""
        self._stop.set()
        for slot in self._slots:
            slot.wake()
        until = time.monotonic() + CLOSING
        for slot in self._slots:
            if slot.thread.is_alive():
                slot.thread.join(max(0.0, until - time.monotonic()))
        for jobs in self._jobs.values():
            while not jobs.empty():
                job = jobs.get_nowait()
                if job is not None and job.future.set_running_or_notify_cancel():
                    job.future.set_result(SolverAnswer(death="cancelled", detail="the server stopped"))


class _Slot:
    """One process and the thread that started it: processes die with that thread."""

    def __init__(
        self, settings: ServiceSettings, lane: Lane, jobs: "queue.Queue[SolverJob | None]", stop: threading.Event
    ) -> None:
        self._settings, self._lane, self._jobs, self._stop = settings, lane, jobs, stop
        self.thread = threading.Thread(target=self._serve, name=f"solver-{lane}", daemon=True)
        self._worker: WorkerProcess | None = None
        self._at_need = lane in AT_NEED
        self.warm = self._at_need
        self._seen = time.monotonic()

    def wake(self) -> None:
        """Have it look whether it is to end, by a job that is none."""
        self._jobs.put(None)

    def memory(self) -> float:
        """Resident memory of the process and what it started, MB."""
        worker = self._worker
        return 0.0 if worker is None or worker.gone else machine.resident(worker.processes())

    @property
    def serves(self) -> bool:
        """Whether the thread lives and looks at the clock."""
        return self.thread.is_alive() and time.monotonic() - self._seen < STUCK

    def _serve(self) -> None:
        """Serve jobs until the pool is closed."""
        while not self._stop.is_set():
            self._seen = time.monotonic()
            with self._survived("failed; its process is exchanged"):
                self._serve_one()
        self._end()

    @contextmanager
    def _survived(self, what: str) -> Iterator[None]:
        """Log what is raised within, and wait: a thread that ended would serve nobody any more."""
        try:
            yield
        except BaseException:
            _log.exception("%s %s", self.thread.name, what)
            self._stop.wait(RESPITE)

    def _serve_one(self) -> None:
        """Serve the next job, if there is one soon; its future is set whatever happens."""
        if not self._at_need:  # have a process before a job comes; where none can be, the job is answered nevertheless
            with self._survived("has no process that is ready"):
                self._ready()
        try:
            job = self._jobs.get(timeout=LOOK)
        except queue.Empty:
            return
        if job is None or not job.future.set_running_or_notify_cancel():
            return
        answer = SolverAnswer(death="crashed", detail="no process can be started")
        try:
            if (worker := self._ready()) is not None:  # which may have ended since the last look
                answer = job.too_late() or self._carry_out(worker, job)
        except BaseException as error:
            answer = SolverAnswer(death="crashed", detail=f"internal error: {type(error).__name__}: {error}")
            self._end()  # who knows what it would answer next
            raise
        finally:
            job.future.set_result(answer)
        if self._lane in ONE_JOB:
            self._end()

    def _ready(self) -> WorkerProcess | None:
        """The process, started anew if it has ended; None if none starts."""
        if self._worker is not None and self._worker.exit_seen():
            self._end()
        if self._worker is None:
            self.warm = self._at_need
            self._worker, ready = WorkerProcess(MODULES.get(self._lane, MODULE)), False
            try:
                ready = self._set_up(self._worker)
            finally:
                if not ready:
                    self._end()
            self.warm = ready or self._at_need
        return self._worker

    def _set_up(self, worker: WorkerProcess) -> bool:
        """Wait for a new process and have it load what its jobs need; return whether it is ready."""
        began = time.monotonic()
        while not (worker.pid or worker.gone or self._stop.is_set() or time.monotonic() - began > START):
            worker.greet(POLL)
            self._seen = time.monotonic()
        set_up = {
            "do": "set up",
            "base": str(self._settings.upload_folder),
            "folders": [str(folder) for folder in self._settings.readable],
            "bodies": self._settings.bodies,
            "memory": self._settings.memory,
            "nice": NICE[self._lane],
            "warm_up": WARM_UP.get(self._lane, "plan"),
        }
        if worker.pid:
            self._carry_out(worker, SolverJob(set_up, START))
        return bool(worker.pid) and not worker.gone

    def _carry_out(self, worker: WorkerProcess, job: SolverJob) -> SolverAnswer:
        worker.begin(job.request)
        deadline, looked = min(time.monotonic() + job.wall, job.until), time.monotonic()
        while True:
            while not job.said.empty() and worker.hears():
                worker.say(job.said.get_nowait())
            message = worker.message(job.look)
            if message is not None and message["phase"] == "answered":
                _pass_on(job.answered, _answer_of(message))
            elif message is not None and message["phase"] == "done":
                memory = machine.resident([worker.pid])
                if message.get("spoilt") or memory > SPOILT_BY * self._settings.memory:
                    self._end()
                return _answer_of(message)
            elif message is not None:
                _pass_on(job.told, message)
            self._seen = now = time.monotonic()
            if worker.gone or now - looked >= POLL:  # a look costs more than a message
                looked = now
                if (death := self._death(worker, job, deadline)) is not None:
                    self._end()
                    return death

    def _death(self, worker: WorkerProcess, job: SolverJob, deadline: float) -> SolverAnswer | None:
        """Why the process has ended or has to end; None when all is well."""
        if worker.gone:
            death = worker.autopsy()
            return SolverAnswer(death=death.kind, detail=f"{death.detail} {death.how}".strip())
        if job.cancel.is_set() or self._stop.is_set():
            return SolverAnswer(death="cancelled", detail="cancelled")
        if time.monotonic() > deadline:
            return SolverAnswer(death="timeout", detail=f"no answer within the hard limit of {job.wall:.3g} s")
        memory = machine.resident(worker.processes())
        if memory > self._settings.memory:
            limit = self._settings.memory
            return SolverAnswer(death="out-of-memory", detail=f"{memory:.0f} MB resident; the limit is {limit:.0f} MB")
        return None

    def _end(self) -> None:
        self.warm = self._at_need
        worker, self._worker = self._worker, None
        if worker is not None:
            with suppress(OSError):  # its keeper ends it
                worker.kill()


def _pass_on(listener: Callable[[Any], None], news: Any) -> None:
    """Hand news to who listens; what goes wrong there is not the job's fault."""
    try:
        listener(news)
    except Exception:
        _log.exception("news of a job were not taken")


def _answer_of(message: Mapping[str, Any]) -> SolverAnswer:
    """The answer in a message, without the keys of its transport; its files come in one piece."""
    whole, files, at = message.get("content", b""), {}, 0
    for name, size in message["sizes"].items():
        files[name] = whole[at : at + size]
        at += size
    return SolverAnswer({key: value for key, value in message.items() if key not in TRANSPORT}, files)


TRANSPORT = ("phase", "sizes", "blob", "content", "spoilt")
"""Keys of a message that are not its content."""
