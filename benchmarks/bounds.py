"""How near the best known motions are to the optimum, proved: gaps without and with obstacles, by set.

    python benchmarks/bounds.py --robot panda --markdown bounds-panda.md     # 350 problems, 20 s each
    python benchmarks/bounds.py --robot ur5 --sets table_under_pick --every 5
    python benchmarks/bounds.py --examples                     # the shipped problems whose goals are values of joints

Problems are read as by `mbm.py`; the motion of each is the shortest verified one of `benchmarks/best_known`, or for the
shipped problems that of `op.plan`. Gap is its duration over the bound, less 1: *alone* of the bound without obstacles,
*proved* of that with them. *Raised* counts problems whose bound the obstacles raised, *after s* is when half of them
had the bound that they ended with. A problem whose gap without obstacles is below `--enough` is not searched: it counts
with that gap. `below` has to be 0: motions shorter than a bound. The last line printed is one JSON object.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported: figures are for one core

import argparse
import tempfile
from pathlib import Path
from typing import Any

from published import by_set, commit, import_sets, percentiles, print_json, print_table, sets_parser, write_markdown
from rich.console import Console
from rich.progress import track

import optiplan as op
from optiplan.bench.results.best_known import BestKnownTable
from optiplan.verify.bounds.bound import bound_of, unsupported

BEST_KNOWN = Path(__file__).parent / "best_known"
EXAMPLES = ("12_planar", "15_srra", "16_delbot", "17_puma560", "18_baxter_dual")
HEADINGS = (
    "set",
    "n",
    "alone: gap % 50 / 80 / 90 / max",
    "proved: gap % 50 / 80 / 90 / max",
    "raised",
    "after s",
    "below",
)


def parse() -> argparse.Namespace:
    """Read the command line."""
    parser = sets_parser(__doc__)
    parser.add_argument("--examples", action="store_true", help="shipped problems in the place of MotionBenchMaker")
    parser.add_argument("--enough", type=float, default=0.005, help="gap without obstacles that is not searched")
    return parser.parse_args()


def main() -> None:
    """Import, bound, print."""
    arguments = parse()
    rows: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as folder:
        try:
            for name, problem, duration in track(
                list(problems(arguments, Path(folder))), "bounds", console=Console(stderr=True), transient=True
            ):
                rows.append({"set": name, **measured(problem, duration, arguments)})
        except KeyboardInterrupt:
            pass
    table = list(lines(rows))
    print_table(HEADINGS, table)
    write_markdown(arguments.markdown, HEADINGS, table)
    print_json({"robot": arguments.robot, "budget": arguments.budget, "commit": commit(), "runs": rows})


def problems(arguments: argparse.Namespace, folder: Path) -> Any:
    """Names of sets, problems, and the durations, s, of the best motions known of them."""
    if arguments.examples:
        for name in EXAMPLES:
            problem = op.load_problem(name)
            yield "examples", problem, op.plan(problem.with_parts(clearance=0), budget=5.0).duration
        return
    known = BestKnownTable(BEST_KNOWN / f"mbm-{arguments.robot}.csv")
    sets = import_sets(arguments.robot, folder, arguments.every, arguments.offset)
    for name in arguments.sets or sets:
        for file in sets[name]:
            try:
                problem = op.load_problem(file)
            except op.InputError:  # a start or a goal that touches something
                continue
            if (ratio := known.ratio(problem.hash, 1.0)) is not None and unsupported(problem) is None:
                yield name, problem, 1.0 / ratio


def measured(problem: op.Problem, duration: float, arguments: argparse.Namespace) -> dict[str, Any]:
    """The bounds of one problem, s, and the gaps of a motion of this duration."""
    alone = float(problem.lower_bounds([goal.q for goal in problem.goal]).min())
    enough = duration <= alone * (1.0 + arguments.enough)
    found = bound_of(problem, 0.0 if enough else arguments.budget, duration)
    return {
        "problem": problem.name,
        "duration": duration,
        "alone": found.alone,
        "proved": found.seconds,
        "gap_alone": duration / found.alone - 1.0,
        "gap": duration / found.seconds - 1.0,
        "after": found.history[-1][0],
        "raised": found.seconds > found.alone,
        "below": duration < found.seconds * (1.0 - 1e-9),
        "history": [list(one) for one in found.history],
    }


def lines(rows: list[dict[str, Any]]) -> Any:
    """One line a set and one for all, in the order of `HEADINGS`."""
    for name, group in by_set(rows).items():
        gaps = [
            " / ".join(f"{100.0 * p:.1f}" for p in percentiles((row[key] for row in group), 50, 80, 90, 100))
            for key in ("gap_alone", "gap")
        ]
        raised = [row for row in group if row["raised"]]
        after = percentiles((row["after"] for row in raised), 50)[0]
        below = sum(row["below"] for row in group)
        yield (name, str(len(group)), *gaps, str(len(raised)), f"{after:.1f}" if raised else "–", str(below))


if __name__ == "__main__":
    main()
