"""Paths of the tool at a held speed: the three coverage surfaces, a metre of glue, and a patch that is polished.

    python benchmarks/seams.py                                     # all of them
    python benchmarks/seams.py wok --markdown /tmp/seams.md        # one surface
    python benchmarks/publish.py seams /tmp/seams.md --readme docs/how-to/paths.md

The surfaces are those of `$OPTIPLAN_SHARED/tours/coverage` (Wang and Gleicher, 2025): every target is passed, in rows
or rings, at a speed that is held; their order is ours, the file has none. Where no posture leads on, a path ends and
the next begins at the last target passed: *paths* counts these, and there is no jump within one. *Joint movement* is
the length of the paths in the space of the joints, rad. The authors store no results and time no motion.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported: figures are for one core

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from published import SHARED, finish, print_table, table_parser

import optiplan as op
from optiplan.planners import base
from optiplan.problem.seams.actions import SeamPath

TOURS = SHARED / "tours"
SPEEDS = {"floor": 0.1, "wok": 0.05, "wokreal": 0.05}
"""m/s."""

SHIPPED = ("53_glue_line", "54_polishing")
_SAMPLES = 20_000
_LEAST = 3
"""Targets of a path, where one has to be given up."""


@dataclass
class Figures:
    """What is counted of the paths over one surface."""

    name: str
    robot: str
    targets: int
    speed: float
    length: float = 0.0
    paths: int = 0
    seconds: float = 0.0
    moved: float = 0.0
    off: float = 0.0
    uneven: float = 0.0
    planning: float = 0.0
    verified: bool = True
    left_out: list[str] = field(default_factory=list)

    def add(self, run: op.Run) -> None:
        """Count a path that was planned."""
        assert run.trajectory is not None
        action = path_of(run.problem)
        self.paths += 1
        self.verified &= run.report is not None and run.report.verified
        along = [one for one in run.trajectory.segments if one.kind == "path" and one.name == "path"]
        self.length += action.curve.length
        self.seconds += along[-1].end - along[0].begin
        Q = run.trajectory(np.linspace(along[0].begin, along[-1].end, _SAMPLES))
        self.moved += float(np.linalg.norm(np.diff(Q, axis=0), axis=1).sum())
        for check in run.report.checks if run.report is not None else ():
            if check.name == "path" and check.worst is not None:
                self.off = max(self.off, check.worst)
            if check.name == "path speed" and check.worst is not None:
                self.uneven = max(self.uneven, check.worst / action.speed)

    def cells(self) -> list[str]:
        """Return a row of the table."""
        left = f" ({len(self.left_out)} left out)" if self.left_out else ""
        return [
            self.name,
            self.robot,
            f"{self.targets}{left}" if self.targets else "–",
            f"{self.length:.2f}",
            f"{self.speed:g}",
            str(self.paths),
            f"{self.seconds:.1f}",
            f"{self.moved:.1f}",
            f"{1e3 * self.off:.3f}",
            f"{100.0 * self.uneven:.3f}",
            f"{self.planning:.1f}",
            "yes" if self.verified else "no",
        ]


def path_of(problem: op.Problem) -> SeamPath:
    """Return the path of a task."""
    return next(step.action for step in problem.task if isinstance(step.action, SeamPath))


def rows_of(p: np.ndarray, chosen: np.ndarray, along: int, *, back: bool) -> Iterator[int]:
    """Yield the numbers of points (N, 3) in rows of one coordinate, to and fro."""
    across = np.round(p[:, 1 - along], 3)
    for k, value in enumerate(sorted(set(across[chosen].tolist()), reverse=back)):
        own = np.flatnonzero(chosen & (across == value))
        own = own[np.argsort(p[own, along])]
        yield from (own[::-1] if k % 2 else own).tolist()


def in_rows(p: np.ndarray) -> list[int]:
    """Return the order about the robot's base: from behind on its right to behind on its left."""
    x, y = p[:, 0], p[:, 1]
    beside = np.abs(y) < 0.27
    parts = [
        (rows_of(p, (x < 0.0) & beside & (y < 0.0), 0, back=True)),
        (rows_of(p, y < -0.27, 1, back=False)),
        (rows_of(p, (x > 0.0) & beside, 0, back=False)),
        (rows_of(p, y > 0.27, 1, back=True)),
        (rows_of(p, (x < 0.0) & beside & (y >= 0.0), 0, back=True)),
    ]
    return [k for part in parts for k in part]


def in_rings(p: np.ndarray) -> list[int]:
    """Return the order in rings from the middle outwards, each begun where the one before leads to."""
    middle = 0.5 * (p[:, :2].min(axis=0) + p[:, :2].max(axis=0))
    radius = np.round(np.linalg.norm(p[:, :2] - middle, axis=1), 2)
    angle = np.arctan2(p[:, 1] - middle[1], p[:, 0] - middle[0])
    found: list[int] = []
    for value in sorted(set(radius.tolist())):
        own = np.flatnonzero(radius == value)
        own = own[np.argsort(angle[own])]
        if len(found) > 1:
            ahead = p[found[-1]] + 0.7 * (p[found[-1]] - p[found[-2]])
            own = np.roll(own, -int(np.linalg.norm(p[own] - ahead, axis=1).argmin()))
            around = np.concatenate([own[:1], own[:0:-1]])
            way = p[own[0]] - p[found[-1]]
            if way @ (p[around[1]] - p[own[0]]) > way @ (p[own[1]] - p[own[0]]):
                own = around
        found += own.tolist()
    return found


def surface(name: str, budget: float) -> Figures:
    """Plan the paths over a coverage surface."""
    data = yaml.safe_load((TOURS / "coverage" / f"{name}.yaml").read_text())
    targets = data["targets"]
    p = np.array([one["position"] for one in targets])
    order = in_rows(p) if name == "floor" else in_rings(p)
    kind = "axis" if data["tolerance"]["free_turn"] else "quaternion"
    points = [{"position": targets[k]["position"], kind: targets[k][kind]} for k in order]
    folder = Path(data["robot"]).parent.name
    robot = op.load_robot(str(TOURS / "robots" / folder / "robot.yaml"))
    q = np.clip(data["start"], robot.limits.lower, robot.limits.upper)
    curve = {"curve": "line", "ramp": 0.02} if name == "floor" else {"curve": "spline"}
    figures = Figures(name, folder.removeprefix("coverage_"), len(points), SPEEDS[name])
    begin = 0
    while begin < len(points) - 1:
        end = len(points)
        while end - begin >= 2:
            path = op.Path(points[begin:end], SPEEDS[name], frame=data["tool_frame"], **curve)
            since = time.process_time()
            run = op.plan(op.Problem(robot, q, task=path, name=f"{name} from {begin}"), budget=budget)
            figures.planning += time.process_time() - since
            if run.trajectory is not None:
                figures.add(run)
                q = run.trajectory.end
                break
            end = _before(points[begin:end], run.failure, begin, end)
        if end - begin < _LEAST and end < len(points):
            figures.left_out.append(str(targets[order[begin]]["name"]))
        begin = max(end - 1, begin + 1) if end < len(points) else len(points)
    return figures


def _before(points: Sequence[Any], failure: op.Failure | None, begin: int, end: int) -> int:
    """Return the number after the last target before a place where no posture leads on."""
    place = None if failure is None else failure.witness.get("path")
    if place is None:
        return begin + (end - begin) // 2
    p = np.array([one["position"] for one in points])
    way = np.concatenate([[0.0], np.cumsum([np.linalg.norm(b - a) for a, b in pairwise(p)])])
    inside = int(np.searchsorted(way, 0.97 * place * way[-1] / max(way[-1], 1e-9)))
    return begin + min(max(inside, 1), end - begin - 1)


def shipped(name: str, budget: float) -> Figures:
    """Plan a problem that OptiPlan ships."""
    problem = op.load_problem(name)
    figures = Figures(name, problem.robot.name, 0, path_of(problem).speed)
    since = time.process_time()
    run = op.plan(problem, budget=budget)
    figures.planning = time.process_time() - since
    if run.trajectory is None:
        figures.verified = False
        return figures
    figures.add(run)
    return figures


def main() -> None:
    """Plan the paths and print the table; budgets count the processor's time, so that another load hardly shows."""
    base.clock = time.process_time
    parser = table_parser(__doc__)
    parser.add_argument("names", nargs="*", default=[*SPEEDS, *SHIPPED], help="surfaces and problems")
    parser.add_argument("--budget", type=float, default=300.0, help="s, of each path")
    arguments = parser.parse_args()
    found = []
    for name in arguments.names:
        found.append(surface(name, arguments.budget) if name in SPEEDS else shipped(name, arguments.budget))
        print_table(("surface",), [found[-1].cells()])
    headings = (
        *("path", "robot", "targets", "length, m", "speed, m/s", "paths", "along them, s"),
        *("joint movement, rad", "off path, mm", "off speed, %", "planning, s", "verified"),
    )
    rows = [one.cells() for one in found]
    finish(arguments.markdown, headings, rows, {"runs": [vars(one) for one in found]})


if __name__ == "__main__":
    main()
