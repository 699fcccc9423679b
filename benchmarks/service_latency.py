"""Measure how much longer `POST /api/plan` takes than the planning itself, with everything warm.

    python benchmarks/service_latency.py --requests 200

Overhead is the caller's waiting time less that of planning, proof and metrics in the answer: HTTP,
reading the problem, the way to the process and back, the motion as JSON. Requests differ in seed or start. Also
shown: the same through `optiplan.service.cell`, which turns the answer into arrays.
"""

import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from published import print_table, table_parser, write_markdown
from service_process import HTTP, serving, wait_until_ready

from optiplan.resources import problems_dir
from optiplan.service.cell import CellPlanner

PROBLEMS = ("01_reach", "07_any_of", "12_planar", "14_half_space", "19_lspb")
PAUSE = 0.1
"""s before each request: the run before is kept by then, which would take the processor from this one."""
HEADINGS = ("problem", "by", "requests", "overhead ms 50 %", "90 %", "99 %", "planning ms 50 %")
WARM = 5
"""Requests before any is measured."""


def overheads(plan: Callable[[int], float], requests: int) -> np.ndarray:
    """Return the ms that requests took beyond planning; `plan` makes one and returns the seconds of planning."""
    found = []
    for number in range(WARM + requests):
        time.sleep(PAUSE)
        began = time.perf_counter()
        planned = plan(number)
        found.append(1e3 * (time.perf_counter() - began - planned))
    return np.array(found[WARM:])


def over_http(url: str, text: str) -> Callable[[int], float]:
    """One request for the text of a problem."""

    def plan(number: int) -> float:
        answer = HTTP.post(f"{url}/api/plan", json={"problem": text, "seed": number, "budget": 5.0})
        answer.raise_for_status()
        timings = answer.json()["timings"]
        return sum(timings.get(key, 0.0) for key in ("plan", "verify", "other proofs", "measure"))

    return plan


def from_a_cell(url: str, file: Path, start: Sequence[float]) -> Callable[[int], float]:
    """One request of a cell, each from another start."""
    cell = CellPlanner(url, file)

    def plan(number: int) -> float:
        motion = cell.plan([*start[:-1], start[-1] + 1e-4 * number], budget=5.0)
        if not motion.verified:
            raise RuntimeError(f"{file}: {motion.status}: {motion.reason}")
        return motion.seconds

    return plan


def main() -> None:
    """Measure and print a table."""
    parser = table_parser(__doc__)
    parser.add_argument("--requests", type=int, default=200)
    parser.add_argument("--problems", nargs="+", default=list(PROBLEMS), help="names of examples")
    given = parser.parse_args()
    rows = []
    with tempfile.TemporaryDirectory() as folder, serving(Path(folder) / "data", "--log-level", "error") as server:
        wait_until_ready(server.url)
        for name in given.problems:
            file = problems_dir() / f"{name}.yaml"
            scene = HTTP.post(f"{server.url}/api/scene", json={"problem": file.read_text()}).json()
            ways = {
                "HTTP": over_http(server.url, file.read_text()),
                "cell": from_a_cell(server.url, file, scene["start"]),
            }
            for way, plan in ways.items():
                planned: list[float] = []

                def kept(number: int, plan: Callable[[int], float] = plan, planned: list[float] = planned) -> float:
                    planned.append(plan(number))
                    return planned[-1]

                ms = np.percentile(overheads(kept, given.requests), [50, 90, 99])
                figures = [f"{x:.1f}" for x in (*ms, 1e3 * float(np.median(planned[WARM:])))]
                rows.append([name, way, str(given.requests), *figures])
                print(rows[-1], file=sys.stderr, flush=True)
    print_table(HEADINGS, rows)
    write_markdown(given.markdown, HEADINGS, rows)


if __name__ == "__main__":
    main()
