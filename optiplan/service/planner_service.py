"""`PlannerService`: a server's parts, put together; what callers wait for, live sessions, benches and pictures."""

from optiplan.service.benches import Benches
from optiplan.service.live_sessions import LiveSessions
from optiplan.service.pictures import Pictures
from optiplan.service.run_service import RunService
from optiplan.service.settings import ServiceSettings
from optiplan.service.store.bench_table import BenchTable
from optiplan.service.store.run_table import Record
from optiplan.service.waited_plans import WaitedPlans


class PlannerService(RunService):
    """All that a server does, apart from HTTP.

    Attributes:
        pictures: of runs and problems, for lists.
        live: controllers that run.
        benches: problems by planners.
        waited: plans that callers wait for.
    """

    def __init__(self, settings: ServiceSettings, serving: bool = True) -> None:
        """Open the database and the folder, as `RunService` does; nothing is started."""
        super().__init__(settings, serving)
        self.pictures, self.live = Pictures(self), LiveSessions(self, self.pool, settings.live)
        self.benches = Benches(self, BenchTable(self.engine), self.runs, self.queue)
        self.waited = WaitedPlans(self)

    async def run(self, run: str) -> Record:
        """A run, also one that a caller waited for and that is being stored.

        Raises:
            Refusal: there is none of that id.
        """
        await self.waited.kept(run)
        return await super().run(run)
