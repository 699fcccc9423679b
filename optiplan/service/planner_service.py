"""`PlannerService`: a server's parts, put together."""

from optiplan.service.archive import Archive, outdated, sweep
from optiplan.service.benches import Benches
from optiplan.service.execution.event_writer import EventWriter
from optiplan.service.execution.run_queue import RunQueue
from optiplan.service.execution.run_solver import RunSolver
from optiplan.service.execution.solver_pool import Lane, SolverPool
from optiplan.service.health import HealthCheck, WriteProbe, feed_watchdog
from optiplan.service.live_sessions import LiveSessions
from optiplan.service.pictures import Pictures
from optiplan.service.queued_plans import QueuedPlans
from optiplan.service.requests import ProblemRequests
from optiplan.service.settings import ServiceSettings
from optiplan.service.waited_plans import WaitedPlans


class PlannerService:
    """All that a server does, apart from HTTP.

    Attributes:
        settings: what it was made with.
        archive: what is kept: runs, problems, benches, contents, uploads.
        pool: the solver processes.
        queue: the durable queue.
        health: says whether this process can work.
        requests: problems as processes take them, and their checks.
        queued: plans that nobody waits for.
        waited: plans that callers wait for.
        live: controllers that run.
        benches: problems by planners.
        pictures: of runs and problems, for lists; pages of runs.
    """

    def __init__(self, settings: ServiceSettings, serving: bool = True) -> None:
        """Open the database and the folder; nothing is started.

        Args:
            settings: of the process.
            serving: whether callers wait for it; else it only takes runs from the queue.

        Raises:
            OptiPlanError: one of them cannot be used.
        """
        self.settings, self.archive = settings, Archive(settings)
        archive = self.archive
        callers: dict[Lane, int] = {"plan": settings.interactive, "look": 1, "live": settings.live} if serving else {}
        self.pool = SolverPool(settings, {**callers, "queue": settings.solvers})
        events = EventWriter(archive.runs)
        solver = RunSolver(settings, events, archive.contents, self.pool)
        self.queue = RunQueue(settings, archive.engine, archive.runs, events, solver)
        self.health = HealthCheck(self.pool, self.queue, WriteProbe(archive.engine), archive.contents)
        self.requests = ProblemRequests(settings, archive, self.pool)
        self.queued = QueuedPlans(settings, archive, self.requests, self.queue)
        self.waited = WaitedPlans(settings, archive, self.requests, self.pool, solver)
        self.live = LiveSessions(self.requests, self.pool, settings.live)
        self.benches = Benches(settings, archive, self.requests, self.queued, self.queue)
        self.pictures = Pictures(archive, self.requests)

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
        self.archive.close()

    def tidy(self) -> None:
        """Delete runs and uploads that are too old or too much, and contents that nothing refers to."""
        for run in outdated(self.archive.runs, self.settings):
            self.queued.forget(run)
        sweep(self.archive.contents, self.archive.runs, self.archive.problems)
        self.archive.uploads.sweep(self.settings.keep_days)
