"""Storage of a server: runs, problems, benches, contents and uploads, accessed from worker threads."""

import asyncio
import json
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

from optiplan.runs.run_folder import RUN, TRAJECTORY
from optiplan.service.refusals import Refusal, not_found
from optiplan.service.settings import ServiceSettings
from optiplan.service.store.contents import ContentFolder
from optiplan.service.store.even_clock import EvenClock
from optiplan.service.store.keyed_tables import BenchTable, ProblemTable
from optiplan.service.store.run_table import ENDED, Record, RunTable
from optiplan.service.store.tables import open_database, store_name
from optiplan.service.store.uploads import Uploads
from optiplan.service.store.write_probe import WriteProbe

Result = TypeVar("Result")

WRITERS, READERS = 4, 8
"""Threads that write to the database, and that read from it."""
PATIENCE = 5.0
"""s that a request for a run waits until the run is stored."""
YOUNG = 3600.0
"""s: younger contents may belong to a run that is being recorded."""


def has_page(record: Mapping[str, Any]) -> bool:
    """Whether a run left a record, which its page shows: one that was ended from outside has none."""
    return RUN in (record.get("contents") or {})


class Archive:
    """Database, contents and uploads of one process.

    Attributes:
        engine: of the database.
        runs: the table of runs.
        problems: the table of stored problems.
        benches: the table of benches.
        contents: the folder of contents.
        uploads: the folder of uploaded files.
        clock: whether it goes evenly.
        probe: whether database and disk take changes.
        saving: runs that were answered and are being stored, by id.
    """

    def __init__(self, settings: ServiceSettings) -> None:
        """Open the database and the folders.

        Raises:
            OptiPlanError: one of them cannot be used.
        """
        self.contents = ContentFolder(settings.data / "contents", settings.spare)
        self.uploads = Uploads(settings.upload_folder, settings.uploads, settings.upload_files)
        self.engine = open_database(settings.database_url)
        self.contents.claim(store_name(self.engine))
        self.runs, self.problems = RunTable(self.engine), ProblemTable(self.engine)
        self.benches, self.clock = BenchTable(self.engine), EvenClock(self.engine)
        self.probe = WriteProbe(self.engine, self.contents)
        self.saving: dict[str, asyncio.Future[None]] = {}
        self._writers = ThreadPoolExecutor(WRITERS, "write")
        self._readers = ThreadPoolExecutor(READERS, "read")

    def close(self) -> None:
        """End the threads and the connections."""
        self._writers.shutdown()
        self._readers.shutdown()
        self.engine.dispose()

    async def read(self, look: Callable[[], Result]) -> Result:
        """Run a query in a reader thread."""
        return await asyncio.get_running_loop().run_in_executor(self._readers, look)

    async def write(self, change: Callable[[], Result]) -> Result:
        """Make a change in a writer thread."""
        return await asyncio.get_running_loop().run_in_executor(self._writers, change)

    async def run(self, run: str) -> Record:
        """Return a run; wait for one that is being stored.

        Raises:
            Refusal: no run has this id.
        """
        if (saving := self.saving.get(run)) is not None:
            await asyncio.wait([saving], timeout=PATIENCE)
        record = await self.read(lambda: self.runs.get(run))
        if record is None:
            raise not_found("run", run)
        return record

    async def content(self, record: Record, name: str) -> bytes:
        """Return a file of a run.

        Raises:
            Refusal: the run has no file of this name.
        """
        digest = (record["contents"] or {}).get(name)
        content = None if digest is None else await self.read(lambda: self.contents.get(digest))
        if content is None:
            raise Refusal(404, f"the run '{record['id']}' is {record['status']} and has no {name}")
        return content

    async def texts(self, record: Record) -> dict[str, str]:
        """Return the texts of a run's record (`run`) and motion (`trajectory`, empty without one).

        Raises:
            Refusal: it has no record.
        """
        motion = await self.content(record, TRAJECTORY) if TRAJECTORY in (record["contents"] or {}) else b""
        return {"run": (await self.content(record, RUN)).decode(), "trajectory": motion.decode()}

    async def stored_request(self, record: Record) -> Record:
        """Return the problem of a run as processes take it.

        Raises:
            Refusal: its content is gone.
        """
        stored = await self.read(lambda: self.contents.get(record["request"]))
        if stored is None:
            raise Refusal(404, f"the problem of the run '{record['id']}' is not in the folder of contents")
        found: Record = json.loads(stored)
        return found

    async def motion_request(self, record: Record) -> Record:
        """Return the problem of a run as processes take it, with its `motion`.

        Raises:
            Refusal: the run has no motion, or its content is gone.
        """
        motion = (await self.content(record, TRAJECTORY)).decode()
        return {**await self.stored_request(record), "motion": motion}


def outdated(runs: RunTable, settings: ServiceSettings) -> list[str]:
    """Return the ended runs that are too old, or exceed the bytes to keep after newer ones."""
    ended = sorted(runs.of_states(ENDED), key=lambda record: record["submitted"], reverse=True)
    oldest, total, found = runs.now() - settings.keep_days * 86400.0, 0, []
    for record in ended:
        total += record["bytes"]
        if record["submitted"] < oldest or total > settings.keep_bytes:
            found.append(record["id"])
    return found


def sweep(contents: ContentFolder, runs: RunTable, problems: ProblemTable, young: float = YOUNG) -> int:
    """Delete contents without a run or problem; return how many."""
    there = contents.older_than(young)
    used = runs.digests_in_use() | problems.digests_in_use()
    for digest in there - used:
        contents.delete(digest)
    return len(there - used)
