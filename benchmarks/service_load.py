"""Many submissions at once: is any lost or done twice, how fast are status answers meanwhile, how much memory is taken?

    python benchmarks/service_load.py --runs 200

Threads of this process send all at the same time, each with another seed. Then the status of random runs is requested,
one after the other, until all have ended.
"""

import random
import tempfile
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import httpx
import numpy as np
from published import table_parser, write_markdown
from service_outages import QUICK
from service_process import serving, wait_until_ready

from optiplan.bench.execution.machine import descendants, resident

HEADINGS = ("submissions at once", "done", "taken within s", "ended within s", "status ms 50 / 95 / 99 %", "memory MB")
SENDERS = 50
"""Threads, each with a connection."""
PATIENCE = 600.0  # s


@dataclass(frozen=True)
class Load:
    """What came of it.

    Attributes:
        runs: asked for.
        states: of the runs at the end.
        ids: different ones; as many as runs.
        sending: s until all were taken.
        seconds: until all had ended.
        status: ms of each status answer while runs were solved.
        memory: most MB of the server and all its processes.
    """

    runs: int
    states: Counter[str]
    ids: int
    sending: float
    seconds: float
    status: np.ndarray
    memory: float


def load(url: str, pid: int, runs: int) -> Load:
    """Submit so many runs at once and watch."""
    limits = httpx.Limits(max_connections=SENDERS)
    with httpx.Client(base_url=url, trust_env=False, timeout=120.0, limits=limits) as http:

        def submit(seed: int) -> str:
            answer = http.post("/api/runs", json={"problem": QUICK, "seed": seed, "budget": 5.0})
            answer.raise_for_status()
            run: str = answer.json()["id"]
            return run

        began, memory = time.monotonic(), 0.0
        with ThreadPoolExecutor(SENDERS) as senders:
            ids = list(senders.map(submit, range(runs)))
        sending, rng, times = time.monotonic() - began, random.Random(0), []
        while time.monotonic() - began < PATIENCE:
            for _ in range(20):
                asked = time.perf_counter()
                http.get(f"/api/runs/{rng.choice(ids)}").raise_for_status()
                times.append(1e3 * (time.perf_counter() - asked))
                time.sleep(0.01)
            memory = max(memory, resident([pid, *descendants(pid)]))
            counts = http.get("/api/runs?limit=1").json()["counts"]
            if not counts.get("queued") and not counts.get("running"):
                break
        seconds = time.monotonic() - began
        states = Counter(http.get(f"/api/runs/{run}").json()["status"] for run in ids)
    return Load(runs, states, len(set(ids)), sending, seconds, np.array(times), memory)


def main() -> None:
    """Run it and tell."""
    parser = table_parser(__doc__)
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--solvers", type=int, default=2)
    given = parser.parse_args()
    arguments = ("--log-level", "error", "--solvers", str(given.solvers))
    with tempfile.TemporaryDirectory() as folder, serving(Path(folder) / "data", *arguments) as server:
        wait_until_ready(server.url)
        found = load(server.url, server.pid, given.runs)
    middle, high, most = np.percentile(found.status, [50, 95, 99])
    print(f"{given.runs} runs at once, taken in {found.sending:.1f} s, all ended after {found.seconds:.1f} s")
    print(f"{found.ids} different ids; at the end: {dict(found.states)}")
    print(f"{len(found.status)} status answers meanwhile: {middle:.1f} / {high:.1f} / {most:.1f} ms (50 / 95 / 99 %)")
    print(f"memory of all processes: at most {found.memory:.0f} MB")
    row = [str(given.runs), str(found.states["done"]), f"{found.sending:.1f}", f"{found.seconds:.1f}"]
    row += [f"{middle:.1f} / {high:.1f} / {most:.1f}", f"{found.memory:.0f}"]
    write_markdown(given.markdown, HEADINGS, [row])
    raise SystemExit(0 if found.states["done"] == found.ids == given.runs else 1)


if __name__ == "__main__":
    main()
