"""Submit runs while server and workers are killed at random; count runs lost, done twice, or answered in part.

    python benchmarks/service_faults.py --rounds 20 --jobs 100
    python benchmarks/service_faults.py --rounds 20 --jobs 100 --postgres --workers 2
    python benchmarks/service_faults.py --rounds 0 --jobs 100 --postgres --workers 2    (who did what)
    python benchmarks/service_faults.py --rounds 20 --outages 2 10 60 full --at-once 6
    python benchmarks/service_faults.py --rounds 20 --outages 2 10 60 full --at-once 6 --postgres

Every run ends once: the log of ends that the database keeps (one event `end` a run) says so. Every answer that a
server gives is whole: `run.json` and `trajectory.json` of each run that is done are fetched and verified offline.

With `--outages`, nothing is killed: the database goes away for so many seconds, or its disk is full, while a run is
solved (`service_outages.py`). Runs submitted before, during and after it end, each once; `/readyz` of server and worker
tells the outage as long as it lasts, and is ok afterwards; no thread dies; SIGTERM ends all processes within their
grace, in every second round while the database is away again. The rounds of an outage run `--at-once` side by side.
"""

import argparse
import json
import random
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
import sqlalchemy as sa
from published import print_table, table_parser, write_markdown
from service_outages import HEADINGS as OUTAGE_HEADINGS
from service_outages import QUICK, Kind, Round, outage_rounds, outage_row
from service_process import HTTP, Program, postgres

from optiplan.problem.load import problem_from_dict
from optiplan.service.settings import ServiceSettings
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.verify import verify

HEADINGS = ("database", "workers", "kills", "done and verified", "lost", "done twice", "broken answers", "refused")
HEADINGS += ("runs by process", "restart s 50 % / longest")


@dataclass
class Findings:
    """What came of it: `done`, s of `restarts`, runs that each process solved as `shares`; all others are faults."""

    done: int = 0
    restarts: list[float] = field(default_factory=list)
    lost: list[str] = field(default_factory=list)
    twice: list[str] = field(default_factory=list)
    broken: list[str] = field(default_factory=list)
    refused: list[str] = field(default_factory=list)
    shares: Counter[str] = field(default_factory=Counter)

    @property
    def faultless(self) -> bool:
        """Whether nothing was wrong."""
        return not (self.lost or self.twice or self.broken or self.refused)


@dataclass(frozen=True)
class Plan:
    """How much is submitted and killed.

    Attributes:
        rounds: kills.
        jobs: runs in all.
        workers: processes beside the server; 0: the server solves.
        seed: of the chances.
        shared: runs that end before the first kill; the shares are of them.
    """

    rounds: int = 20
    jobs: int = 100
    workers: int = 0
    seed: int = 0
    shared: int = 0


def faults(folder: Path, database: str, plan: Plan) -> Findings:
    """Submit jobs over several rounds, end each by kill -9 of one process, and count the results.

    Args:
        folder: for the data.
        database: URL; empty: SQLite.
        plan: how much.
    """
    rng, found = random.Random(plan.seed), Findings()
    rounds, jobs, workers = plan.rounds, plan.jobs, plan.workers
    shared = ["--data", str(folder / "data"), *(["--database", database] if database else [])]
    serve = ["serve", "--port", "0", *shared, "--solvers", "0" if workers else "2"]
    work = ["worker", *shared, "--solvers", "1"]
    with ExitStack() as stack:
        programs = [Program(*serve, log=folder / "log"), *(Program(*work, log=folder / "log") for _ in range(workers))]
        stack.callback(lambda: [program.kill() for program in programs])
        ids: dict[str, int] = {}
        for job in range(plan.shared):
            _submit(programs[0].url, jobs + job, ids)
        _look(programs[0].url, ids, found)
        shared, ids = ids, {}
        for job in range(0 if rounds else jobs):
            _submit(programs[0].url, job, ids)
        for number in range(rounds):
            wanted = range(jobs * number // rounds, jobs * (number + 1) // rounds)
            for job in wanted:
                _submit(programs[0].url, job, ids)
            time.sleep(rng.uniform(0.0, 1.5))
            which = rng.randrange(len(programs))
            programs[which].kill()
            programs[which] = Program(*(serve if which == 0 else work), log=folder / "log")
            found.restarts.append(programs[which].started)
        _look(programs[0].url, ids, found)
    _count_ends(ServiceSettings(data=folder / "data", database=database).database_url, shared or ids, found)
    return found


def _submit(url: str, job: int, ids: dict[str, int]) -> None:
    answer = HTTP.post(f"{url}/api/runs", json={"problem": QUICK, "seed": job, "budget": 5.0})
    answer.raise_for_status()
    ids[answer.json()["id"]] = job


def _look(url: str, ids: dict[str, int], found: Findings) -> None:
    """Wait for all runs, and hold each of their answers against the verifier."""
    end, problem = time.monotonic() + 180.0 + 1.0 * len(ids), None
    waiting = set(ids)
    while waiting and time.monotonic() < end:
        for run in sorted(waiting):
            state = HTTP.get(f"{url}/api/runs/{run}").json()["status"]
            if state in ("failed", "cancelled"):
                found.refused.append(run)
            if state in ("done", "failed", "cancelled"):
                waiting.discard(run)
        time.sleep(0.2)
    found.lost += sorted(waiting)
    for run in set(ids) - waiting - set(found.refused):
        try:
            record: dict[str, Any] = HTTP.get(f"{url}/api/runs/{run}/run.json").json()
            motion = Trajectory.from_dict(HTTP.get(f"{url}/api/runs/{run}/trajectory.json").json())
            problem = problem or problem_from_dict(record["problem"])
            whole = record["verified"] and record["seed"] == ids[run] and verify(problem, motion).verified
        except (ValueError, KeyError, httpx.HTTPError):
            whole = False
        found.done += bool(whole)
        if not whole:
            found.broken.append(run)


def _count_ends(url: str, ids: dict[str, int], found: Findings) -> None:
    """Look for runs that ended twice, and for who solved those of `ids`."""
    engine = sa.create_engine(url)
    with engine.connect() as connection:
        rows = connection.execute(sa.text("SELECT run, data FROM optiplan_events ORDER BY number")).all()
    ends = Counter(run for run, data in rows if '"end"' in str(data).replace("'", '"'))
    found.twice = sorted(run for run, count in ends.items() if count > 1)
    begun = [(run, json.loads(data) if isinstance(data, str) else data) for run, data in rows]
    last = {run: data["by"] for run, data in begun if data.get("status") == "running"}  # of tries, the one that ended
    found.shares = Counter(by for run, by in last.items() if run in ids)
    engine.dispose()


def main() -> None:
    """Run it and tell."""
    parser = table_parser(__doc__)
    parser.add_argument("--rounds", type=int, default=20)
    parser.add_argument("--jobs", type=int, default=100)
    parser.add_argument("--workers", type=int, default=0)
    parser.add_argument("--postgres", action="store_true", help="a server of Debian's package, started for this")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--outages", nargs="+", metavar="S", help="s that the database is away, or 'full': its disk is")
    parser.add_argument("--at-once", type=int, default=4, metavar="N", help="rounds of an outage side by side")
    given = parser.parse_args()
    if given.outages:
        lengths = [None if word == "full" else float(word) for word in given.outages]
        kind: Kind = "PostgreSQL" if given.postgres else "SQLite"
        found = {length: outage_rounds(kind, length, given.rounds, given.at_once) for length in lengths}
        rows = [outage_row(kind, length, rounds) for length, rounds in found.items()]
        print_table(OUTAGE_HEADINGS, rows)
        write_markdown(given.markdown, OUTAGE_HEADINGS, rows)
        raise SystemExit(_tell_faults(found))
    _killed(given)


def _tell_faults(found: Mapping[float | None, Sequence[Round]]) -> int:
    """Print what was wrong in which round; return the exit code."""
    for length, rounds in found.items():
        for number, one in enumerate(rounds):
            for fault in one.faults:
                print(
                    f"outage {'full' if length is None else f'{length:g} s'}, round {number}: {fault}", file=sys.stderr
                )
    return int(any(one.faults for rounds in found.values() for one in rounds))


def _killed(given: argparse.Namespace) -> None:
    """Run the rounds of kills and tell."""
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="optiplan-faults-")))
        database = stack.enter_context(postgres()) if given.postgres else ""
        began = time.monotonic()
        found = faults(folder, database, Plan(given.rounds, given.jobs, given.workers, given.seed))
        with suppress(OSError):
            print(
                f"{'PostgreSQL' if database else 'SQLite'}, {given.workers} workers, {time.monotonic() - began:.0f} s"
            )
    print(f"{given.rounds} kills, {given.jobs} jobs: {found.done} done and verified, {len(found.lost)} lost, ")
    print(f"{len(found.twice)} done twice, {len(found.broken)} broken answers, {len(found.refused)} refused")
    restarts = sorted(found.restarts)
    seconds = f"{restarts[len(restarts) // 2]:.2f} / {restarts[-1]:.2f}" if restarts else ""
    print(f"restart until it answers, s, median / longest: {seconds}; by process: {sorted(found.shares.values())}")
    counts = [found.lost, found.twice, found.broken, found.refused]
    where = "PostgreSQL" if given.postgres else "SQLite"
    row = [
        where,
        str(given.workers),
        str(given.rounds),
        f"{found.done} of {given.jobs}",
        *(str(len(x)) for x in counts),
    ]
    row.append("" if given.rounds else " / ".join(str(count) for count in sorted(found.shares.values())))
    write_markdown(given.markdown, HEADINGS, [[*row, seconds]])
    raise SystemExit(0 if found.faultless else 1)


if __name__ == "__main__":
    main()
