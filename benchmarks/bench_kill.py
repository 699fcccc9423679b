"""Kill the runner of a suite and its workers at random moments, continue each time, and count the runs at the end.

    python benchmarks/bench_kill.py                  # twenty kills, a few minutes
    python benchmarks/bench_kill.py --kills 5 --seed 3

The suite: two numbered examples, the planner `quintic` and one that waits 0.1 s, with many repetitions, two workers.
Each round starts the same command, waits a random time (every fifth round from the start, else from the first run) and
sends SIGKILL: in turn to the runner, to one worker and a second later to the runner, to both at once.
At the end the suite is completed and compared with an undisturbed one: every run once, the same verdicts and motions,
a database that SQLite finds whole, exit codes 0, and no process left. The last line printed is one JSON object.
"""

import argparse
import json
import os
import random
import signal
import sqlite3
import subprocess
import sys
import tempfile
import time
from contextlib import closing
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
REPETITIONS = 400
LONGEST = 3.0  # s to the kill, from the start of every fifth command, and of others from their first run


def main() -> None:
    """Kill, go on, compare."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    rng = random.Random(arguments.seed)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        suite = write_suite(folder, REPETITIONS)
        rounds = [one_round(suite, folder / "killed", rng, number) for number in range(arguments.kills)]
        for _ in range(2):  # the second finds nothing left to do
            code = start(suite, folder / "killed").wait()
        peace = start(suite, folder / "peace").wait()
        killed, left = rows(folder / "killed"), rows(folder / "peace")
        result = {
            "kills": arguments.kills,
            "runs": 4 * REPETITIONS,
            "stored": len(killed),
            "each_once": len(set(killed)) == len(killed) == 4 * REPETITIONS,
            "same_as_in_peace": killed == left,
            "integrity": integrity(folder / "killed"),
            "exit_codes": [code, peace],
            "rounds": rounds,
        }
    print(json.dumps(result))
    whole = result["each_once"] and result["same_as_in_peace"] and result["integrity"] == "ok"
    orphans = sum(one["orphans"] for one in rounds)
    sys.exit(0 if whole and not (code or peace or orphans) else 1)


def write_suite(folder: Path, repetitions: int) -> Path:
    """The suite file."""
    problems = [
        {"glob": str(ROOT / "problems" / f"{name}*.yaml"), "set": "examples"} for name in ("10_ur3", "12_planar")
    ]
    planners = ["quintic", {"name": "bench_overhead:Waits", "label": "waits", "seconds": 0.1}]
    suite = {"version": 1, "name": "kill", "problems": problems, "planners": planners, "budget": 5}
    path = folder / "kill.yaml"
    path.write_text(json.dumps(suite | {"repetitions": repetitions}))
    return path


def start(suite: Path, folder: Path) -> "subprocess.Popen[bytes]":
    """The command, with two workers."""
    command = [sys.executable, "-c", "from optiplan.cli.main import main; main()", "bench", str(suite)]
    command += ["--out", str(folder), "--workers", "2"]
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "benchmarks"), *filter(None, sys.path)]),
    }
    return subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def one_round(suite: Path, folder: Path, rng: random.Random, number: int) -> dict[str, Any]:
    """Start, wait, kill; what was killed when, and how many runs there were then."""
    before, process = len(rows(folder)), start(suite, folder)
    began = time.perf_counter()
    while number % 5 and len(rows(folder)) == before and process.poll() is None:
        time.sleep(0.02)
    time.sleep(rng.uniform(0.0, LONGEST))
    victim = ("runner", "worker", "both")[number % 3]
    if victim != "runner":
        for pid in children(process.pid)[:1]:
            os.kill(pid, signal.SIGKILL)
    if victim == "worker":
        time.sleep(rng.uniform(0.0, 1.0))
    moment, orphans, alive = time.perf_counter() - began, children(process.pid), process.poll() is None
    process.kill()
    process.wait()
    end = time.perf_counter() + 5.0
    while (left := sum(Path(f"/proc/{pid}").exists() for pid in orphans)) and time.perf_counter() < end:
        time.sleep(0.05)  # on a busy machine a process takes a moment to go
    made = len(rows(folder)) - before
    return {"killed": victim, "after": round(moment, 2), "alive": alive, "made": made, "orphans": left}


def children(pid: int) -> list[int]:
    """Process ids of the workers."""
    try:
        threads = Path(f"/proc/{pid}/task").iterdir()
        return [int(child) for thread in threads for child in (thread / "children").read_text().split()]
    except OSError:
        return []


def rows(folder: Path) -> list[tuple[Any, ...]]:
    """Key, verdict and motion of every run."""
    sql = "SELECT problem, planner, seed, repetition, verified, failure_kind, trajectory FROM runs ORDER BY 1, 2, 3, 4"
    try:
        with closing(sqlite3.connect(f"file:{folder}/results.sqlite?mode=ro", uri=True)) as db:
            return db.execute(sql).fetchall()
    except sqlite3.OperationalError:  # not there yet
        return []


def integrity(folder: Path) -> str:
    """What SQLite says of the file."""
    with closing(sqlite3.connect(folder / "results.sqlite")) as db:
        return str(db.execute("PRAGMA integrity_check").fetchone()[0])


if __name__ == "__main__":
    main()
