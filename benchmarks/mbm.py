"""MotionBenchMaker with one planner: verified share, planning time, duration over lower bound.

    python benchmarks/mbm.py --planner trajopt                 # 350 Panda problems, about 20 minutes on one core
    python benchmarks/mbm.py --robot fetch --every 5 --offset 2 --markdown fetch.md
    python benchmarks/mbm.py --planner rrtconnect --sets box cage --count 10

Problems are read from `$OPTIPLAN_SHARED/mbm/<robot>` (by default `../shared` beside the checkout). Each result is
judged twice: *verified* is the verifier's word; *confirmed* is a second look that shares nothing with it but the robot
files: the robot's triangle meshes as they are, not hulls, against the obstacles, by plain collision queries at joint
steps of at most 0.01 rad. Problems that are bad input, since their start or goal collides, are counted and listed; all
shares are of the others. *First* is the time after which the first verified answer was there, *cpu* processor time of
planning. *Best known* is the duration over the shortest ever verified and confirmed, from `benchmarks/best_known`;
`--update` writes what beats it (or is new) into that table. *Within 1 s* (`--within`) is the same for the best verified
answer that was there 1 s after planning began, proof included; a problem without one counts as infinitely long. Ctrl-C
ends early and still prints what was done. The last line printed is one JSON object.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported: figures are for one core

import argparse
import json
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from published import (
    SHARED,
    by_set,
    commit,
    import_sets,
    percentiles,
    print_json,
    print_table,
    sets_parser,
    write_markdown,
)
from rich.console import Console
from rich.progress import track

import optiplan
from optiplan.bench.execution.run_task import hash_and_pack
from optiplan.bench.results.best_known import BestKnown, BestKnownTable
from optiplan.collision.model import CollisionModel
from optiplan.errors import InputError
from optiplan.planners.base import Budget
from optiplan.problem.load import load_problem
from optiplan.problem.problem import Problem
from optiplan.robot.robot import Robot, load_robot
from optiplan.runs.pipeline import run
from optiplan.runs.run import Run
from optiplan.trajectory.trajectory import Trajectory

BEST_KNOWN = Path(__file__).parent / "best_known"
AGAINST = ("over_best", "ratio_within", "over_best_within")
STEP = 0.01  # rad, largest joint step of the second look
HEADINGS = (
    "set",
    "n",
    "bad input",
    "verified",
    "confirmed",
    "plan s 50 / 95 / max",
    "cpu s 50",
    "first s 50 / 95",
    "verify s 50",
    "ratio 50 / 90",
    "best known 50 / 90",
    "within {within:g} s: ratio 50 / 90",
    "within {within:g} s: best known 50 / 90",
    "duration sum s",
)


def parse() -> argparse.Namespace:
    """Read the command line."""
    parser = sets_parser(__doc__)
    parser.add_argument("--planner", default="trajopt")
    parser.add_argument("--count", type=int, help="only the first COUNT of these problems of each set")
    parser.add_argument("--within", type=float, default=1.0, help="s, after which answers are compared as well")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--best-known", type=Path, help="table of best known durations (benchmarks/best_known/…)")
    parser.add_argument("--update", action="store_true", help="write durations that beat it into that table")
    return parser.parse_args()


def main() -> None:
    """Import, plan, print."""
    arguments = parse()
    known = BestKnownTable(arguments.best_known or BEST_KNOWN / f"mbm-{arguments.robot}.csv")
    rows: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as folder:
        sets = import_sets(arguments.robot, Path(folder), arguments.every, arguments.offset)
        wanted = arguments.sets or list(sets)
        files = [file for name in wanted for file in sets[name][: arguments.count]]
        look = SecondLook(SHARED / "robots" / f"mbm_{arguments.robot}" / "robot.yaml", Path(folder))
        try:
            warm_up(files, arguments)
            for file in track(files, "planning", console=Console(stderr=True), transient=True):
                rows.append(solve(file, arguments, look, known))
                if arguments.update and rows[-1].get("beaten"):
                    known.write()
        except KeyboardInterrupt:
            pass
    remarks = [] if len(rows) == len(files) else [f"Interrupted after {len(rows)} of {len(files)} problems."]
    remarks += [line for row in rows if (line := in_words(row))]
    table, headings = list(lines(rows)), [name.format(within=arguments.within) for name in HEADINGS]
    print_table(headings, table)
    for remark in remarks:
        Console(stderr=True, width=160).print(f"- {remark}", markup=False)
    listed = ["\n".join(f"- {remark}" for remark in remarks)] if remarks else []
    write_markdown(arguments.markdown, headings, table, listed)
    told = {"planner": arguments.planner, "robot": arguments.robot, "budget": arguments.budget, "commit": commit()}
    print_json({**told, "complete": len(rows) == len(files), **summary(rows), "runs": rows})


def warm_up(files: list[Path], arguments: argparse.Namespace) -> None:
    """Pay for imports with the first problem that can be planned; not counted."""
    for file in files:
        try:
            run(load_problem(file), arguments.planner, {}, Budget(min(5.0, arguments.budget)), silent)
            return
        except InputError:
            continue


def silent(stage: str, fraction: float) -> None:
    """Report no progress."""


def solve(file: Path, arguments: argparse.Namespace, look: "SecondLook", known: BestKnownTable) -> dict[str, Any]:
    """One problem planned, verified, looked at a second time, and held against the best known."""
    row: dict[str, Any] = {"set": file.parent.name, "problem": file.stem, "bad_input": None}
    began = time.perf_counter()
    try:
        problem = load_problem(file, seed=arguments.seed)
    except InputError as error:  # a start or a goal that touches something under this robot's geometry
        return {**row, "bad_input": "; ".join(f"{issue.field}: {issue.found}" for issue in error.issues)}
    row["load_s"] = round(time.perf_counter() - began, 4)
    done = run(problem, arguments.planner, {}, Budget(arguments.budget), silent)
    began = time.perf_counter()
    confirmed = done.trajectory is not None and look.confirms(problem, done.trajectory)
    row |= {"confirmed": confirmed, "look_s": round(time.perf_counter() - began, 4), **measured(done)}
    if not (confirmed and done.verified):
        return row | {"ratio_within": np.inf, "over_best_within": known.ratio(problem.hash, np.inf)}
    beaten = known.offer(entry(f"{row['set']}/{row['problem']}", done, arguments))
    soon = min((duration for seconds, duration in done.improvements if seconds <= arguments.within), default=np.inf)
    over = {"ratio_within": done.ratio * soon / done.duration, "over_best_within": known.ratio(problem.hash, soon)}
    return row | {"beaten": beaten, "over_best": known.ratio(problem.hash, done.duration), **over}


def entry(name: str, done: Run, arguments: argparse.Namespace) -> BestKnown:
    """A verified run as a line of the table of best known durations."""
    return BestKnown(
        problem=name,
        hash=done.problem.hash,
        duration=done.duration,
        planner=arguments.planner,
        options=json.dumps(dict(done.options), sort_keys=True),
        seed=arguments.seed,
        budget=arguments.budget,
        version=f"{optiplan.__version__} {commit()}",
        trajectory=hash_and_pack(done.trajectory)[0],
    )


def measured(done: Run) -> dict[str, Any]:
    """Verdict, times in s and duration of a run."""
    return {
        "planned": done.trajectory is not None,
        "verified": done.verified,
        "plan_s": round(done.timings["plan"], 4),
        "cpu_s": None if done.plan_cpu is None else round(done.plan_cpu, 4),
        "first_s": round(done.improvements[0][0], 4) if done.improvements else None,
        "verify_s": round(done.timings.get("verify", 0.0), 4),
        "duration": done.duration,
        "ratio": done.ratio,
        "improvements": done.improvements,
        "failure": None if done.failure is None else f"{done.failure.kind}: {done.failure.detail}",
        "refused": [check.name for check in done.report.checks if not check.passed] if done.report else [],
    }


class SecondLook:
    """Judges trajectories with the robot's triangle meshes as they are; pairs are those of its SRDF."""

    def __init__(self, source: Path, folder: Path) -> None:
        data = yaml.safe_load(source.read_text())
        data["collision"] = "mesh"
        data |= {key: str(source.parent / data[key]) for key in ("urdf", "srdf")}
        self.file = folder / "mesh_robot.yaml"
        self.file.write_text(yaml.safe_dump(data))
        self._robots: dict[tuple[tuple[str, float], ...], Robot] = {}

    def robot(self, problem: Problem) -> Robot:
        """The mesh robot with its locked joints where the problem puts them."""
        key = tuple(sorted(problem.robot.locked.items()))
        if key not in self._robots:
            self._robots[key] = load_robot(str(self.file), locked=problem.robot.locked)
        return self._robots[key]

    def confirms(self, problem: Problem, trajectory: Trajectory) -> bool:
        """Free of mesh collision at small steps, inside all limits there, from the start to the goal."""
        return self.within(problem, trajectory) and self.free(problem, trajectory)

    def within(self, problem: Problem, trajectory: Trajectory) -> bool:
        """Inside all limits at small steps, from the start to the goal."""
        t = steps(trajectory)
        Q, limits, slack = trajectory(t), problem.limits, 1.0 + 1e-6
        bounds = (limits.velocity, limits.acceleration, limits.jerk)
        return bool(
            (Q >= limits.lower - 1e-9).all()
            and (Q <= limits.upper + 1e-9).all()
            and all((np.abs(trajectory(t, k + 1)) <= bound * slack).all() for k, bound in enumerate(bounds))
            and np.abs(Q[0] - problem.start).max() < 1e-6
            and any(np.abs(Q[-1] - goal.q).max() < 1e-6 for goal in problem.goal if hasattr(goal, "q"))
        )

    def free(self, problem: Problem, trajectory: Trajectory) -> bool:
        """Free of mesh collision at small steps."""
        model = CollisionModel(self.robot(problem), problem.scene)
        return not any(model.collides(q) for q in trajectory(steps(trajectory)))


def steps(trajectory: Trajectory) -> np.ndarray:
    """Times (k,), s, between which no joint moves by more than `STEP` rad or m."""
    peak = np.abs(np.array(trajectory.extrema(1))).max()
    dense = np.linspace(0.0, trajectory.duration, int(np.ceil(trajectory.duration * peak / STEP)) + 1)
    moved = np.abs(np.diff(trajectory(dense), axis=0)).max(axis=1)
    kept, since = [0], 0.0
    for k, step in enumerate(moved):
        if since + step > STEP:
            kept.append(k)
            since = 0.0
        since += step
    return dense[[*dict.fromkeys([*kept, len(dense) - 1])]]


def in_words(row: dict[str, Any]) -> str | None:
    """Why a problem is not verified; None if it is."""
    name = f"{row['set']}/{row['problem']}"
    if row["bad_input"] is not None:
        return f"{name}: bad input: {row['bad_input']}"
    if not row["verified"]:
        return f"{name}: {row['failure'] or 'refused: ' + ', '.join(row['refused'])}"
    return None if row["confirmed"] else f"{name}: verified, not confirmed"


def summary(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Shares, times and what there was within a time of all problems but bad input; the rest of the verified ones."""
    good = [row for row in rows if row["bad_input"] is None]
    verified = [row for row in good if row["verified"]]

    def figures(key: str, of: list[dict[str, Any]], *which: int, digits: int = 3) -> dict[str, float]:
        return dict(
            zip(map(str, which), (round(v, digits) for v in percentiles((r[key] for r in of), *which)), strict=True)
        )

    return {
        "problems": len(rows),
        "bad_input": len(rows) - len(good),
        **{key: sum(row[key] for row in good) for key in ("planned", "verified", "confirmed")},
        **{f"{key}_s": figures(f"{key}_s", good, 50, 90, 95, 100) for key in ("plan", "cpu", "verify", "load", "look")},
        "first_s": figures("first_s", verified, 50, 95, 100),
        "ratio": figures("ratio", verified, 50, 90, 95, 100, digits=4),
        **{key: figures(key, [row for row in good if key in row], 50, 90, 100, digits=4) for key in AGAINST},
        "beaten": sum(row.get("beaten", False) for row in good),
        "duration_sum": round(sum(row["duration"] for row in verified), 4),
    }


def lines(rows: list[dict[str, Any]]) -> Any:
    """One line a set and one for all, in the order of `HEADINGS`."""
    for name, group in by_set(rows).items():
        s = summary(group)
        good = s["problems"] - s["bad_input"]
        shares = (f"{s[key]} of {good} ({100 * s[key] / max(good, 1):.1f} %)" for key in ("verified", "confirmed"))
        plan, first = joined(s["plan_s"], 2, "50", "95", "100"), joined(s["first_s"], 2, "50", "95")
        times = (plan, joined(s["cpu_s"], 2, "50"), first, joined(s["verify_s"], 2, "50"))
        ratios = (joined(s[key], 3, "50", "90") for key in ("ratio", "over_best", "ratio_within", "over_best_within"))
        yield (name, str(s["problems"]), str(s["bad_input"]), *shares, *times, *ratios, f"{s['duration_sum']:.2f}")


def joined(figures: dict[str, float], digits: int, *which: str) -> str:
    """Some percentiles of a figure, – where there is none."""
    known = (figures[p] for p in which)
    return " / ".join("–" if np.isnan(value) else f"{value:.{digits}f}" for value in known)


if __name__ == "__main__":
    main()
