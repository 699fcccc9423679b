"""Plan the available problems of `same_bits.csv` and compare the hashes of their motions.

    python benchmarks/same_bits.py                       # the quick suite, and the Panda problems where they are
    python benchmarks/same_bits.py --planners trajopt --only examples
    python benchmarks/same_bits.py --write now.csv       # hashes of this tree; --against now.csv compares with them

A hash is the first 16 digits of the SHA-256 of breakpoints and coefficients; a failure is named by its kind.
`trajopt` runs with `seeds: 1`, and the clock stands still, so that it ends nothing. A larger `--budget` makes patience
end later; such hashes are compared among themselves, by `--write` and `--against`. Hashes are those of one machine:
another processor rounds otherwise in BLAS.
`--also` adds problem files of any kind (tasks, motion at the ends, obstacles that move).
Exit code 1 where a hash differs from the last column of the table, and where nothing was planned.
"""

import csv
import hashlib
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

from published import ROOT, SHARED, import_sets, script_parser

from optiplan import libraries
from optiplan.bench.suite.suite import load_suite
from optiplan.planners.base import Budget
from optiplan.problem.load import load_problem, problem_from_dict
from optiplan.problem.problem import Problem
from optiplan.runs.pipeline import run

TABLE = Path(__file__).with_name("same_bits.csv")
OPTIONS: dict[str, dict[str, int]] = {"trajopt": {"seeds": 1}}
EVERY, FIRST = 10, 5
"""Of MotionBenchMaker's Panda problems."""


def main() -> None:
    """Plan, compare, print."""
    parser = script_parser(__doc__)
    parser.add_argument("--planners", nargs="+", default=["trajopt", "rrtconnect", "prm", "quintic", "scurve"])
    parser.add_argument("--only", default="", help="beginning of the problems' names")
    parser.add_argument("--also", nargs="*", type=Path, default=[], help="further problem files, with trajopt")
    parser.add_argument("--against", type=Path, default=TABLE, help="table of hashes")
    parser.add_argument("--write", type=Path, help="write hashes and process times here")
    parser.add_argument("--budget", type=float, default=1.0, help="seconds for each run")
    options = parser.parse_args()
    libraries.time = SimpleNamespace(perf_counter=lambda: 0.0)  # type: ignore[assignment]
    known = recorded(options.against)
    differing, rows = 0, []
    with tempfile.TemporaryDirectory() as folder:
        for name, problem in problems(Path(folder), options.only, options.also):
            for planner in options.planners:
                if (name, planner) not in known and not name.startswith("also/"):
                    continue
                began = time.process_time()
                found = digest(problem, planner, options.budget)
                took = time.process_time() - began
                before = known.get((name, planner))
                verdict = "new" if before is None else "same" if found == before else f"DIFFERS from {before}"
                differing += verdict.startswith("DIFFERS")
                rows.append([name, planner, found, f"{took:.3f}"])
                print(f"{name:32} {planner:12} {found:18} {took:8.3f} s  {verdict}", file=sys.stderr, flush=True)
    if options.write:
        with options.write.open("w", newline="") as file:
            csv.writer(file).writerows([["problem", "planner", "now", "process_s"], *rows])
    print(f"{len(rows)} planned, {differing} differ")
    sys.exit(int(differing > 0 or not rows))


def recorded(path: Path) -> dict[tuple[str, str], str]:
    """Return the hashes of a table: of `same_bits.csv` the column `after`."""
    with path.open() as file:
        rows = csv.DictReader(line for line in file if not line.startswith("#"))
        return {(row["problem"], row["planner"]): row.get("after") or row["now"] for row in rows}


def problems(folder: Path, only: str, also: list[Path]) -> Iterator[tuple[str, Problem]]:
    """Yield names and problems: of the quick suite, of the Panda's sets where they are, of further files."""
    for one in load_suite(ROOT / "benchmarks/suites/quick.yaml", folder / "suite").problems:
        if one.id.startswith(only):
            yield one.id, problem_from_dict(one.data, "/")
    if (SHARED / "mbm").is_dir() and "panda".startswith(only[:5]):
        for name, files in import_sets("panda", folder / "sets", EVERY, FIRST - 1).items():
            for file in files:
                yield f"panda/{name}/{file.stem}", load_problem(file)
    for file in also:
        yield f"also/{file.stem}", load_problem(file)


def digest(problem: Problem, planner: str, budget: float) -> str:
    """Return the hash of the motion that a planner finds, or the kind of its failure."""
    done = run(problem, planner, OPTIONS.get(planner, {}), Budget(budget), lambda stage, share: None)
    if done.trajectory is None:
        return done.failure.kind if done.failure else "nothing"
    data = done.trajectory.breakpoints.tobytes() + done.trajectory.coefficients.tobytes()
    return hashlib.sha256(data).hexdigest()[:16]


if __name__ == "__main__":
    main()
