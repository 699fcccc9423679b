"""Two checkouts of OptiPlan on the same problems, in turn: durations and times of the one over those of the other.

    git worktree add /tmp/before 03bbba4          # and build its core: see CONTRIBUTING.md
    git worktree add /tmp/after c3ff269
    python benchmarks/before_after.py /tmp/before /tmp/after --every 9 --markdown before-after.md

Each checkout has a warm process of its own. They answer each problem one after the other, in alternating order, so
that a busy machine is busy for both. Problems: every k-th of MotionBenchMaker's seven Panda
sets. The last line printed is JSON.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported: figures are for one core

import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from published import by_set, import_sets, percentiles, print_json, print_table, table_parser, write_markdown
from rich.console import Console
from rich.progress import track

WORKER = """
import json, sys
sys.meta_path[:] = [finder for finder in sys.meta_path if "Scikit" not in type(finder).__name__]  # of another checkout
sys.path.insert(0, {checkout!r})
import optiplan as op
assert op.__file__.startswith({checkout!r}), op.__file__
from optiplan._core import core
answers, sys.stdout = sys.stdout, sys.stderr
for line in sys.stdin:
    try:
        run = op.plan(op.load_problem(line.strip()), budget={budget!r})
        row = dict(duration=run.duration if run.verified else None, plan=run.timings["plan"], cpu=run.plan_cpu)
    except op.InputError:
        row = None
    print(json.dumps(dict(row=row, core=core is not None)), file=answers, flush=True)
"""

REFUSED = {"duration": None}
"""Row of a problem that is bad input to one checkout; what both refuse does not count."""

HEADINGS = (
    "set",
    "n",
    "verified before",
    "verified after",
    "duration after / before: 10 %",
    "median",
    "90 %",
    "sum",
    "processor time after / before: median",
    "sum",
)


class Checkout:
    """A process that plans with one checkout."""

    def __init__(self, folder: Path, budget: float) -> None:
        code = WORKER.format(checkout=str(folder.resolve()), budget=budget)
        self._process = subprocess.Popen(
            [sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        self.name = subprocess.run(
            ["git", "-C", str(folder), "describe", "--always", "--dirty", "--exclude=*"],
            capture_output=True,
            text=True,
            check=True,
        ).stdout.strip()
        self.core: bool | None = None

    def plan(self, file: Path) -> dict[str, Any] | None:
        """Return duration, s, of planning and of its processor; None for bad input."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(f"{file}\n")
        self._process.stdin.flush()
        answer = json.loads(self._process.stdout.readline())
        self.core = answer["core"]
        row: dict[str, Any] | None = answer["row"]
        return row

    def end(self) -> None:
        """End the process."""
        self._process.terminate()
        self._process.wait()


def main() -> None:
    """Plan in turn and print the table."""
    parser = table_parser(__doc__)
    parser.add_argument("before", type=Path)
    parser.add_argument("after", type=Path)
    parser.add_argument("--every", type=int, default=9, help="every k-th problem of each set")
    parser.add_argument("--offset", type=int, default=0, help="index of the first of them")
    parser.add_argument("--budget", type=float, default=10.0, help="s of each plan")
    options = parser.parse_args()
    rows: list[dict[str, Any]] = []
    ways = [Checkout(folder, options.budget) for folder in (options.before, options.after)]
    try:
        with tempfile.TemporaryDirectory() as folder:
            sets = import_sets("panda", Path(folder), options.every, options.offset)
            files = [file for files in sets.values() for file in files]
            for way in ways:
                way.plan(files[0])  # pays for imports
            for k, file in enumerate(track(files, "planning", console=Console(stderr=True), transient=True)):
                order = ways if k % 2 else ways[::-1]
                found = {way: way.plan(file) for way in order}
                if any(found.values()):
                    before, after = (found[way] or REFUSED for way in ways)
                    rows.append({"set": file.parent.name, "problem": file.stem, "before": before, "after": after})
    except KeyboardInterrupt:
        pass
    finally:
        for way in ways:
            way.end()
    table = [line(name, group) for name, group in by_set(rows).items()]
    print_table(HEADINGS, table)
    remark = f"Before: `{ways[0].name}`, after: `{ways[1].name}`; native core: {ways[0].core}, {ways[1].core}."
    write_markdown(options.markdown, HEADINGS, table, [remark])
    print_json({"before": ways[0].name, "after": ways[1].name, "runs": rows})


def line(name: str, rows: list[dict[str, Any]]) -> list[str]:
    """One row of the table; ratios over what both verified."""
    both = [row for row in rows if row["before"]["duration"] and row["after"]["duration"]]

    def ratios(key: str) -> list[float]:
        return [row["after"][key] / row["before"][key] for row in both]

    def share(key: str) -> float:
        return sum(row["after"][key] for row in both) / max(1e-9, sum(row["before"][key] for row in both))

    return [
        name,
        f"{len(rows)}",
        *(f"{sum(bool(row[way]['duration']) for row in rows)}" for way in ("before", "after")),
        *(f"{value:.3f}" for value in percentiles(ratios("duration"), 10, 50, 90)),
        f"{share('duration'):.3f}",
        f"{percentiles(ratios('cpu'), 50)[0]:.2f}",
        f"{share('cpu'):.2f}",
    ]


if __name__ == "__main__":
    main()
