"""Outages of a server's database while runs are solved, one round each: for `service_faults.py` and demonstrations.

PostgreSQL is stopped and started; SQLite's file is held by another process, which no writer gets past. A full disk is
a small file system of its own, with the database and the contents on it, filled to the last byte (mounting takes root).
"""

import os
import re
import sqlite3
import subprocess
import tempfile
import threading
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median
from typing import Any, Literal

import httpx
from service_process import HTTP, Postgres, Program, free_port, wait_until_ready

from optiplan.service.server import GRACE
from optiplan.service.store.write_probe import FRESH, PATIENCE

Kind = Literal["SQLite", "PostgreSQL"]

QUICK = """\
version: 1
name: quick
robot: planar2r
start: {joints: [0.5, 1.0]}
goal: {joints: [-0.5, 1.2]}
scene: {obstacles: [{name: far, shape: {sphere: 0.1}, pose: {position: [-1, 0.18, 1]}}]}
planner: quintic
"""
"""Planned in a blink."""
SHUT_IN = """\
version: 1
name: shut-in
robot: planar2r
start: {joints: [0.9, 0.5]}
goal: {joints: [-1.5708, 0]}
scene: {obstacles: [{name: ceiling, shape: {box: [3.0, 0.1, 0.04]}, pose: {position: [0, 0.2, 0.75]}}]}
planner: rrtconnect
"""
"""Searched for as long as the budget lasts; the answer is that there is no path."""
LONG = 2.5
"""s that the run takes which the outage meets."""
SECONDS_FULL = 10.0
"""s for which a disk is full."""
DISK = 200
"""MB of the disk that is filled."""
ROOM = FRESH + PATIENCE + 10.0
"""s after which `/readyz` may no longer say ok in an outage, on a busy machine."""
UNTOLD = 60.0
"""s that an outage lasts at most until `/readyz` reports it, on a busy machine."""
AGAIN = 300.0
"""s within which it has to be ok again, and all runs have to end, on a busy machine."""
SLACK = 30.0
"""s beyond its grace after which a process counts as one that does not end, on a busy machine."""
ENDED = ("done", "failed", "cancelled")


@dataclass
class Round:
    """What one outage did: `faults` in words, times in s, runs by how they ended."""

    faults: list[str] = field(default_factory=list)
    told: float | None = None
    again: float | None = None
    stopped: list[float] = field(default_factory=list)
    answered: int = 0
    storage: int = 0
    refused: int = 0


class Disk:
    """A small file system at a folder."""

    def __init__(self, folder: Path) -> None:
        """Mount it.

        Raises:
            RuntimeError: that takes root.
        """
        folder.mkdir()
        self._folder, self._filler = folder, folder / "filler"
        made = subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={DISK}m,mode=755", "tmpfs", str(folder)])
        if made.returncode:
            raise RuntimeError("a full disk needs a file system of its own, and mounting one takes root")

    def fill(self) -> None:
        """Fill it to the last byte."""
        with self._filler.open("ab", buffering=0) as file:
            for size in (1 << 20, 1 << 12, 1):
                with suppress(OSError):
                    while True:
                        file.write(bytes(size))

    def empty(self) -> None:
        """Give the room back."""
        self._filler.unlink(missing_ok=True)

    def close(self) -> None:
        """Unmount it."""
        subprocess.run(["umount", "-l", str(self._folder)])


class Database:
    """The database of one round, which can go away and come back."""

    def __init__(self, kind: Kind, folder: Path, disk: Disk | None) -> None:
        self.data, self._disk = folder / "data", disk
        self._postgres: Postgres | None = None
        self._holder: sqlite3.Connection | None = None
        if kind == "PostgreSQL":
            (folder / "postgres").mkdir()
            self._postgres = Postgres(folder / "postgres")

    @property
    def arguments(self) -> list[str]:
        """What a program needs to use it."""
        url = f"sqlite:///{self.data / 'service.sqlite'}" if self._postgres is None else self._postgres.url
        return ["--data", str(self.data), "--database", url]

    def go(self) -> None:
        """Go away."""
        if self._disk is not None:
            self._disk.fill()
        elif self._postgres is not None:
            self._postgres.stop()
        else:
            self._holder = sqlite3.connect(self.data / "service.sqlite", timeout=60.0, isolation_level=None)
            self._holder.execute("BEGIN EXCLUSIVE")

    def come(self) -> None:
        """Come back."""
        if self._disk is not None:
            self._disk.empty()
        if self._postgres is not None and not self._postgres.runs:
            self._postgres.start()
        if self._holder is not None:
            self._holder.execute("ROLLBACK")
            self._holder.close()
            self._holder = None

    def close(self) -> None:
        """End it."""
        if self._holder is not None:
            self._holder.close()
        if self._postgres is not None:
            self._postgres.stop()


@dataclass(frozen=True)
class Look:
    """An answer about health: times of request and answer, s, path, status and text."""

    asked: float
    given: float
    path: str
    status: int
    text: str


class Looks:
    """Asks for `/readyz` and `/healthz` four times a second, in a thread of its own, until it is closed."""

    def __init__(self, urls: Sequence[str]) -> None:
        self._urls, self._stop = urls, threading.Event()
        self.seen: list[Look] = []
        self._thread = threading.Thread(target=self._look, daemon=True)
        self._thread.start()

    def told(self, since: float) -> list[Look]:
        """The answers requested since a time, s, that report an outage."""
        return [look for look in self.seen if look.path == "readyz" and look.status == 503 and since < look.asked]

    def close(self) -> None:
        """End it."""
        self._stop.set()
        self._thread.join(90.0)

    def _look(self) -> None:
        while not self._stop.wait(0.25):
            for url in self._urls:
                for path in ("readyz", "healthz"):
                    began = time.monotonic()
                    try:
                        answer = HTTP.get(f"{url}/{path}", timeout=20.0)
                        status, text = answer.status_code, answer.text
                    except httpx.HTTPError as error:
                        status, text = 0, f"{url}/{path}: {error or type(error).__name__}"
                    self.seen.append(Look(began, time.monotonic(), path, status, text))


@contextmanager
def _programs(database: Database, workers: int, log: Path) -> Iterator[tuple[list[Program], list[str]]]:
    """A server and its workers, ready, and the addresses of their health."""
    rest = ["--solvers", "1", *database.arguments]
    ports = [free_port() for _ in range(workers)]
    with ExitStack() as stack:
        programs = []
        for words in (["serve", "--port", "0", "--live", "0"], *(["worker", "--health-port", str(p)] for p in ports)):
            programs.append(Program(*words, *rest, log=log))
            stack.callback(programs[-1].kill)
        urls = [programs[0].url, *(f"http://127.0.0.1:{port}" for port in ports)]
        for url in urls:
            wait_until_ready(url)
        yield programs, urls


def outage_round(kind: Kind, outage: float | None, number: int = 0, workers: int = 1) -> Round:
    """One outage during a run, with submissions before, during and after it, and SIGTERM at the end.

    Args:
        kind: of the database.
        outage: s, and longer until `/readyz` reports it; None: a full disk.
        number: of the round; after an odd one the database is away once more when SIGTERM comes.
        workers: beside the server, which solves too.
    """
    found = Round()
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="optiplan-outage-")))
        folder.chmod(0o755)
        disk, place = None, folder
        if outage is None:
            disk, place = Disk(folder / "disk"), folder / "disk"
            stack.callback(disk.close)
        database = Database(kind, place, disk)
        stack.callback(database.close)
        programs, urls = stack.enter_context(_programs(database, workers, folder / "log"))
        _go_through(found, database, urls, SECONDS_FULL if outage is None else outage, number)
        _stop(found, database, programs, number)
        log = (folder / "log").read_text()
        for match in re.findall(r"Exception in thread[^\n]*", log):
            found.faults.append(f"a thread died: {match}")
    return found


def _go_through(found: Round, database: Database, urls: list[str], outage: float, number: int) -> None:
    url, first = urls[0], 1000 * number
    ids: dict[str, dict[str, object]] = {}
    refused: list[int] = []

    def submit(seed: int, problem: str = QUICK, budget: float = 5.0) -> str | None:
        given = {"problem": problem, "seed": seed, "budget": budget}
        try:
            answer = HTTP.post(f"{url}/api/runs", json=given, timeout=90.0)
        except httpx.HTTPError as error:
            found.faults.append(f"a submission got no answer: {error or type(error).__name__}")
            return None
        if answer.status_code == 202:
            ids[answer.json()["id"]] = given
            return str(answer.json()["id"])
        refused.append(seed)
        if answer.status_code not in (503, 507):
            found.faults.append(f"a submission got {answer.status_code}: {answer.text[:200]}")
        return None

    submit(first)
    for solver in range(len(urls)):
        met = submit(first + 1 + solver, SHUT_IN, LONG)
    _wait_for(url, str(met), ("running",))
    submit(first + 9)
    looks = Looks(urls)
    time.sleep(0.8)
    database.go()
    gone = time.monotonic()
    with ThreadPoolExecutor(3) as threads:
        during = [threads.submit(submit, first + 10)]
        time.sleep(outage / 2)
        during.append(threads.submit(submit, first + 11))
        time.sleep(max(0.0, gone + outage - time.monotonic()))
        while not looks.told(gone) and time.monotonic() < gone + max(outage, UNTOLD):
            time.sleep(0.05)
        back = time.monotonic()
        database.come()
        up = time.monotonic()
        for one in during:
            one.result()
    with suppress(RuntimeError):
        for each in urls:
            wait_until_ready(each, AGAIN)
        found.again = time.monotonic() - up
    looks.close()
    _judge(found, looks, gone, back)
    found.refused = len(refused)
    for seed in (first + 20, first + 21, *refused[:]):
        submit(seed)
    _look_at_ends(found, url, ids)


def _judge(found: Round, looks: Looks, gone: float, back: float) -> None:
    """Hold the looks at health against the outage from `gone` to `back`."""
    ready = [look for look in looks.seen if look.path == "readyz" and gone < look.asked < back]
    told = [look.given for look in looks.told(gone) if look.asked < back]
    found.told = min(told) - gone if told else None
    if found.told is None:
        found.faults.append("/readyz never told the outage")
    if any(look.status == 200 for look in ready if gone + ROOM < look.asked and look.given < back):
        found.faults.append("/readyz said ok while the outage lasted")
    if found.again is None:
        found.faults.append(f"/readyz is not ok {AGAIN:g} s after the outage: {looks.seen[-2].text[:200]}")
    for look in looks.seen:
        if look.path == "healthz" and look.status != 200:
            found.faults.append(f"/healthz: {look.status} {look.text[:200]}")
            break


def _wait_for(url: str, run: str, states: Sequence[str], patience: float = AGAIN) -> dict[str, Any] | None:
    end = time.monotonic() + patience
    while time.monotonic() < end:
        with suppress(httpx.HTTPError, ValueError):
            answer = HTTP.get(f"{url}/api/runs/{run}")
            if answer.status_code == 200 and answer.json()["status"] in (*states, *ENDED):
                record: dict[str, Any] = answer.json()
                return record
        time.sleep(0.1)
    return None


def _look_at_ends(found: Round, url: str, ids: dict[str, dict[str, object]]) -> None:
    """Wait for all runs: each has the planner's answer, or failed as it could not be kept; each ended once."""
    for run, given in ids.items():
        record = _wait_for(url, run, ())
        if record is not None and _kind(record) == "storage":
            found.storage += 1
            HTTP.post(f"{url}/api/runs", json=given).raise_for_status()  # which tries it again
            record = _wait_for(url, run, ())
        if record is None:
            found.faults.append(f"run {run} is {HTTP.get(f'{url}/api/runs/{run}').json()['status']} for ever")
            continue
        whole = HTTP.get(f"{url}/api/runs/{run}/run.json").status_code == 200
        if given["problem"] == QUICK:
            moved = HTTP.get(f"{url}/api/runs/{run}/trajectory.json").status_code == 200
            answered = record["status"] == "done" and record["verified"] and moved
        else:
            answered = record["status"] == "failed" and _kind(record) == "no-path"
        found.answered += bool(answered and whole)
        if not (answered and whole):
            found.faults.append(f"run {run} is {record['status']}: {record['failure']}")
        ends = HTTP.get(f"{url}/api/runs/{run}/events").text.count("event: end")
        if ends != 1:
            found.faults.append(f"run {run} has {ends} ends")


def _kind(record: dict[str, Any]) -> str:
    """Of its failure; empty without one."""
    return str((record["failure"] or {}).get("kind", ""))


def _stop(found: Round, database: Database, programs: list[Program], number: int) -> None:
    """Send SIGTERM, also while the database is away; each process ends within its grace."""
    if number % 2:
        database.go()
        time.sleep(1.0)
    for program in programs:
        began = time.monotonic()
        try:
            code = program.stop()
        except subprocess.TimeoutExpired:
            found.faults.append("SIGTERM did not end a process")
            continue
        found.stopped.append(time.monotonic() - began)
        if found.stopped[-1] > GRACE + SLACK:
            found.faults.append(f"SIGTERM ended a process after {found.stopped[-1]:.1f} s")
        if code != 0 and not number % 2:
            found.faults.append(f"SIGTERM ended a process by force (exit code {code})")
    if number % 2:
        database.come()


def outage_rounds(kind: Kind, outage: float | None, rounds: int, at_once: int, workers: int = 1) -> list[Round]:
    """So many rounds, `at_once` of them side by side."""

    def one(number: int) -> Round:
        try:
            return outage_round(kind, outage, number, workers)
        except (RuntimeError, OSError, httpx.HTTPError, subprocess.SubprocessError) as error:
            return Round(faults=[f"{type(error).__name__}: {error}"])

    with ThreadPoolExecutor(at_once) as threads:
        return list(threads.map(one, range(rounds)))


HEADINGS = ("database", "outage s", "rounds", "runs answered", "not kept at first", "refused at first")
HEADINGS += ("told after s 50 % / longest", "ok again after s", "SIGTERM s", "faults")


def outage_row(kind: Kind, outage: float | None, rounds: Sequence[Round]) -> list[str]:
    """The row of a table for some rounds."""

    def spread(values: Sequence[float]) -> str:
        return f"{median(values):.1f} / {max(values):.1f}" if values else ""

    return [
        kind,
        f"{SECONDS_FULL:g}, disk full" if outage is None else f"{outage:g}",
        str(len(rounds)),
        *(str(sum(getattr(one, name) for one in rounds)) for name in ("answered", "storage", "refused")),
        spread([one.told for one in rounds if one.told is not None]),
        spread([one.again for one in rounds if one.again is not None]),
        spread([seconds for one in rounds for seconds in one.stopped]),
        str(sum(len(one.faults) for one in rounds)),
    ]


def can_mount() -> bool:
    """Whether a disk can be made and filled here."""
    return os.getuid() == 0
