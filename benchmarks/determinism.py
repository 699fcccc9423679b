"""Same problem, options and seed, same bits: twenty problems alone, after others, reversed, in suites, resumed.

    python benchmarks/determinism.py --markdown determinism.md          # about 15 minutes, two workers for a part of it

Problems: of each of MotionBenchMaker's Panda sets every 14th problem, `table_under_pick` left out, whose searches go on
for as long as the budget lets them; the sets in turn, the first twenty. Each is planned and verified in six ways:

    alone      in a new process of its own;
    after      one after another in one new process;
    reversed   the same in reverse order;
    one, two   by `optiplan bench` with one and with two workers;
    resumed    by `optiplan bench` with one worker, ended after a third of the runs and started again.

The default planner weighs the time that its attempts took against the budget before it makes another, so two runs may
stop after different numbers of attempts. Here the number of attempts is fixed instead: an hour of budget, and the
option `seeds` (sampled paths tried, at most) at 2. `--budget 20 --options '{}'` shows how it is in everyday use.

A trajectory is told by the SHA-256 of its breakpoints and coefficients. Runs that the clock cut short are named: they
may differ. Ctrl-C ends early and prints what was done. The last line printed is one JSON object; exit code 1 if runs
that were not cut short differ.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported, here and in processes started from here

import argparse
import hashlib
import json
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from published import ROOT, commit, import_sets, print_json, print_table, table_parser, write_markdown
from rich.console import Console

from optiplan.bench.execution.pool import LocalPool
from optiplan.bench.execution.runner import open_results, run_suite
from optiplan.bench.suite.suite import load_suite
from optiplan.planners.base import Budget
from optiplan.problem.load import load_problem
from optiplan.runs.pipeline import run
from optiplan.trajectory.trajectory import Trajectory

SETS = ("bookshelf_small", "bookshelf_tall", "bookshelf_thin", "box", "cage", "table_pick")
EVERY = 14
WAYS = ("alone", "after", "reversed", "one worker", "two workers", "resumed")
Found = dict[str, tuple[str, bool]]
"""Problem: hash of its trajectory, or kind of its failure, and whether the clock cut it short."""


class Enough(Exception):
    """Ends a suite early."""


def main() -> None:
    """Plan in all ways, compare, print."""
    parser = table_parser(__doc__)
    parser.add_argument("--planner", default="trajopt")
    parser.add_argument("--problems", type=int, default=20)
    parser.add_argument("--budget", type=float, default=3600.0, help="seconds for each run")
    parser.add_argument("--options", default='{"seeds": 2}', help="of the planner, as JSON")
    parser.add_argument("--ways", nargs="+", choices=WAYS, default=list(WAYS))
    parser.add_argument("--plan", nargs="+", type=Path, help=argparse.SUPPRESS)  # what the new processes do
    options = parser.parse_args()
    if options.plan:
        plan(options.plan, options.planner, json.loads(options.options), options.budget)
        return
    with tempfile.TemporaryDirectory() as folder:
        files = write_problems(Path(folder), options.problems)
        found: dict[str, Found] = {}
        try:
            for way in options.ways:
                Console(stderr=True).print(f"{way} …")
                found[way] = planned(way, files, options)
        except KeyboardInterrupt:
            pass
    sys.exit(report(found, [file.stem for file in files], options))


def report(found: dict[str, Found], names: list[str], options: argparse.Namespace) -> int:
    """Print and write the table; 1 if runs that were not cut short differ."""
    headings = ("problem", "SHA-256 (first 16)", "ways", "identical", "cut short")
    rows, differing, cut = [], [], []
    for name in names:
        runs = {way: runs[name] for way, runs in found.items() if name in runs}
        hashes = dict.fromkeys(digest for digest, _ in runs.values())
        late = [way for way, (_, was_cut) in runs.items() if was_cut]
        cut += [name] if late else []
        differing += [name] if len(hashes) > 1 else []
        shown = ", ".join(digest[:16] for digest in hashes)
        rows.append([name, shown, str(len(runs)), "yes" if len(hashes) <= 1 else "**no**", ", ".join(late) or "–"])
    print_table(headings, rows)
    remark = f"{options.planner} {options.options}, budget {options.budget:g} s; ways: {', '.join(found)}."
    remark += (
        f" {len(names) - len(differing)} of {len(names)} identical, {len(cut)} cut short by the clock in some way."
    )
    write_markdown(options.markdown, headings, rows, [remark])
    told = {"planner": options.planner, "budget": options.budget, "commit": commit(), "ways": list(found)}
    print_json({**told, "problems": len(names), "differing": differing, "cut_short": cut, "runs": found})
    return int(bool(set(differing) - set(cut)))


def write_problems(folder: Path, count: int) -> list[Path]:
    """The problem files, side by side in one folder."""
    sets = import_sets("panda", folder / "sets", EVERY)
    chosen = [file for files in zip(*(sets[name] for name in SETS), strict=True) for file in files][:count]
    target = folder / "problems"
    target.mkdir()
    return [file.rename(target / f"{file.parent.name}_{file.stem}.yaml") for file in chosen]


def planned(way: str, files: list[Path], options: argparse.Namespace) -> Found:
    """All problems planned in one of the ways."""
    if way == "alone":
        return {name: result for file in files for name, result in in_process([file], options).items()}
    if way in ("after", "reversed"):
        return in_process(files if way == "after" else files[::-1], options)
    workers = 2 if way == "two workers" else 1
    return in_suite(files, workers, len(files) // 3 if way == "resumed" else None, options)


def in_process(files: list[Path], options: argparse.Namespace) -> Found:
    """Problems planned one after another in one new process."""
    given = ["--planner", options.planner, "--budget", str(options.budget), "--options", options.options]
    command = [sys.executable, __file__, *given, "--plan", *map(str, files)]
    path = os.pathsep.join(filter(None, (str(ROOT), os.environ.get("PYTHONPATH"))))
    environment = {**os.environ, "PYTHONPATH": path}
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, env=environment, check=True)
    return {name: (digest, cut) for name, digest, cut in map(json.loads, done.stdout.splitlines())}


def plan(files: list[Path], planner: str, settings: dict[str, Any], budget: float) -> None:
    """Plan here; print a line a problem: its name, the hash of its trajectory, whether the clock cut it short."""
    for file in files:
        done = run(load_problem(file), planner, settings, Budget(budget), lambda stage, share: None)
        told = bits(done.trajectory) if done.trajectory else f"failure: {done.failure and done.failure.kind}"
        print(json.dumps([file.stem, told, bool(done.info.get("cut_short"))]), flush=True)


def in_suite(files: list[Path], workers: int, enough: int | None, options: argparse.Namespace) -> Found:
    """Problems planned by a suite; ended after `enough` runs and started again."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        text = {"version": 1, "name": "determinism", "problems": [{"glob": f"{files[0].parent}/*.yaml", "set": "mbm"}]}
        planner = {"name": options.planner, **json.loads(options.options)}
        lines: dict[str, Any] = {**text, "planners": [planner], "budget": options.budget, "seeds": [0]}
        lines["limits"] = {"wall": options.budget + 60, "memory": 4000}
        (folder / "suite.yaml").write_text("\n".join(f"{key}: {json.dumps(value)}" for key, value in lines.items()))
        suite = load_suite(folder / "suite.yaml", folder / "files")
        for stop_at in (enough, None) if enough else (None,):
            with open_results(suite, folder / "results") as store:
                try:
                    run_suite(suite, store, LocalPool(workers), "here", stopper(stop_at))
                except Enough:
                    continue
                return dict(of_store(store))
    raise AssertionError("a suite ends once it is not interrupted")


def stopper(enough: int | None) -> Any:
    """What watches a suite and ends it after so many runs."""
    seen: list[object] = []

    def watch(outcome: object) -> None:
        seen.append(outcome)
        if len(seen) == enough:
            raise Enough

    return watch


def of_store(store: Any) -> Iterator[tuple[str, tuple[str, bool]]]:
    """Name, hash and whether it was cut short, of every run."""
    for row in store.query("SELECT problem, trajectory, failure_kind, cut_short FROM runs"):
        told = bits(store.trajectory(row["trajectory"])) if row["trajectory"] else f"failure: {row['failure_kind']}"
        yield row["problem"].rpartition("/")[2], (told, bool(row["cut_short"]))


def bits(trajectory: Trajectory) -> str:
    """SHA-256 of breakpoints and coefficients."""
    return hashlib.sha256(trajectory.breakpoints.tobytes() + trajectory.coefficients.tobytes()).hexdigest()


if __name__ == "__main__":
    main()
