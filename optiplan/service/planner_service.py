"""`PlannerService`: the parts of a server."""

import math
from dataclasses import replace

from optiplan.service.archive import Archive, outdated, sweep
from optiplan.service.benches import Benches
from optiplan.service.execution.event_writer import EventWriter
from optiplan.service.execution.run_queue import RunQueue
from optiplan.service.execution.run_solver import RunSolver
from optiplan.service.execution.solver_pool import Lane, SolverPool
from optiplan.service.health import HealthCheck, feed_watchdog
from optiplan.service.pictures import Pictures
from optiplan.service.queued_plans import QueuedPlans
from optiplan.service.requests import ProblemRequests
from optiplan.service.sessions.execution_sessions import ExecutionSessions
from optiplan.service.sessions.live_sessions import LiveSessions
from optiplan.service.settings import ServiceSettings
from optiplan.service.waited_plans import WaitedPlans
from optiplan.viewer.drawing.drawing import Drawing


class PlannerService:
    """Everything that a server does, apart from HTTP.

    Attributes:
        settings: of this process.
        archive: runs, problems, benches, contents and uploads.
        pool: the solver processes.
        queue: the durable queue.
        health: whether this process can work.
        requests: problems as processes take them, and their checks.
        queued: plans in the queue.
        waited: plans whose callers wait.
        live: running controllers.
        executions: motions that are executed.
        benches: problems by planners.
        pictures: pictures of runs and problems, and pages of runs.
    """

    def __init__(self, settings: ServiceSettings, serving: bool = True) -> None:
        """Open the database and the folder without starting anything.

        Args:
            settings: of the process.
            serving: whether it answers callers; else it only takes runs from the queue.

        Raises:
            OptiPlanError: the database or the folder cannot be used.
        """
        self.settings, self.archive = settings, Archive(settings)
        archive = self.archive
        callers: dict[Lane, int] = {"plan": settings.interactive, "look": 1, "report": 1} if serving else {}
        callers |= {"live": settings.live, "execution": len(settings.drivers)} if serving else {}
        self.pool = SolverPool(settings, {**callers, "queue": settings.solvers})
        events = EventWriter(archive.runs)
        solver = RunSolver(settings, events, archive.contents, self.pool)
        self.queue = RunQueue(settings, archive.engine, archive.runs, events, solver)
        self.health = HealthCheck(self.pool, self.queue, archive.probe)
        self.requests = ProblemRequests(settings, archive, self.pool)
        self.queued = QueuedPlans(settings, archive, self.requests, self.queue)
        self.waited = WaitedPlans(settings, archive, self.requests, self.pool, solver)
        self.live = LiveSessions(self.requests, self.pool, settings.live)
        self.executions = ExecutionSessions(self.requests, archive, self.waited, self.pool, settings.drivers)
        self.health.also.append(self.executions.faults)
        self.benches = Benches(settings, archive, self.requests, self.queued, self.queue)
        self.meshcat_url: str | None = None  # once scripts can draw
        self.drawing = None if settings.meshcat_port is None else Drawing()
        self.pictures = Pictures(archive, self.requests)

    def start(self) -> None:
        """Start the queue, then the processes, whose warm-up takes the processor for seconds."""
        self.queue.start()
        self.pool.start()
        self._watchdog = feed_watchdog(lambda: self.health.living()[0] == 200)

    def close(self) -> None:
        """Stop everything; put running runs back into the queue."""
        self.queue.close()
        self.pool.close()
        self._watchdog.set()
        self.archive.close()

    def tidy(self) -> None:
        """Delete runs and uploads beyond the limits, and contents without a run or problem.

        What is only too old stays while the clock has not gone evenly.
        """
        even = self.archive.clock.even()
        limits = self.settings if even else replace(self.settings, keep_days=math.inf)
        for run in outdated(self.archive.runs, limits):
            self.queued.forget(run)
        if even:
            sweep(self.archive.contents, self.archive.runs, self.archive.problems)
        self.archive.uploads.sweep(limits.keep_days)
