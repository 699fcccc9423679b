"""Tours of the Airbus drilling benchmark beside the published methods, growth with the number of targets, optimality.

    python benchmarks/tours.py                                     # 25 to 245 holes, without and with limits of jerk
    python benchmarks/tours.py --markdown /tmp/tours.md
    python benchmarks/tours.py --growth                            # 10 to 1,000 targets on the same panel
    python benchmarks/tours.py --optimality                        # up to 12 targets: beside the best of all orders
    python benchmarks/publish.py tours /tmp/tours.md --readme docs/how-to/tours.md

Holes, scene, limits and published figures are those of `$OPTIPLAN_SHARED/tours/airbus` (RoboTSP, 2018). A tour goes
from home through all holes, rests at each, and back; the turn about the drill is free. Execution is the sum of all
legs. *Planning* is the time of one core for the search, the motions and all proofs. The published times are of another
machine. *Joint distances*: one configuration a hole, the soonest from home, in
OR-Tools' order for their joint distances, with our motions.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported: figures are for one core

import time
from collections.abc import Sequence
from typing import Any

import numpy as np
import yaml
from published import SHARED, finish, table_parser

import optiplan as op
from optiplan.planners import base
from optiplan.planners.base import Budget
from optiplan.planners.registry import make_planner
from optiplan.planners.task.stages import Stages, WorldState
from optiplan.planners.tours.ladder import Choice
from optiplan.planners.tours.order import OrderSearch
from optiplan.planners.tours.search import TourSearch
from optiplan.problem.load import problem_from_dict
from optiplan.problem.task.steps import TargetTour
from optiplan.runs.pipeline import run

AIRBUS = SHARED / "tours" / "airbus"
SIZES = (25, 50, 100, 150, 200, 245)
BEST = (17.7, 25.0, 39.3, 53.0, 64.5, 74.7)
"""s, the shortest published execution of each size, of any method."""

GROWTH = (10, 30, 100, 300, 1000)
FEW = (4, 6, 8, 10, 12)
TURNS, FEW_TURNS = 24, 12
"""Turns of the drill: of the tour with one configuration a hole, and where all orders are compared."""


def airbus(targets: Sequence[dict[str, Any]], *, jerk: bool) -> op.Problem:
    """Return the problem of visiting targets of the panel."""
    data = yaml.safe_load((AIRBUS / "scene.yaml").read_text())
    file = {
        "version": 1,
        "name": f"airbus_{len(targets)}",
        "robot": str(AIRBUS.parent / "robots" / "vs060" / "robot.yaml"),
        "start": {"configuration": "home"},
        "scene": data,
        "task": [{"tour": {"targets": list(targets), "standoff": 0.01, "closed": True}}],
        "limits": {} if jerk else {"jerk": "none"},
    }
    return problem_from_dict(file, AIRBUS)


def holes(count: int) -> list[dict[str, Any]]:
    """Return the published subset of the holes of this size."""
    data = yaml.safe_load((AIRBUS / "targets.yaml").read_text())
    chosen = data["subsets"].get(count, range(len(data["targets"])))
    return [data["targets"][k] for k in chosen]


def spread(count: int) -> list[dict[str, Any]]:
    """Return targets by the rule of the holes: a square grid over the same cross, as fine as the number takes."""
    every = np.array([one["position"] for one in holes(245)])
    low, high = every.min(axis=0), every.max(axis=0)
    for step in np.linspace(0.1, 0.005, 400):
        y, z = np.meshgrid(np.arange(low[1], high[1] + 1e-9, step), np.arange(low[2], high[2] + 1e-9, step))
        points = np.column_stack([y.ravel(), z.ravel()])
        far = np.abs(points[:, None] - every[None, :, 1:]).max(axis=2).min(axis=1)
        inside = points[far <= 0.0125 + 1e-9]
        if len(inside) >= count:
            kept = inside[np.linspace(0, len(inside) - 1, count).astype(int)]
            return [{"position": [0.57, *map(float, row)], "axis": [1, 0, 0]} for row in kept]
    raise ValueError(f"the grid has no {count} points")


def planned(problem: op.Problem, budget: float) -> dict[str, Any]:
    """Plan one tour; return its execution and the time of one core that search, motions and all proofs took."""
    began = time.process_time()
    found = run(problem, "trajopt", {}, Budget(budget), lambda *_: None)
    spent = time.process_time() - began
    return {
        "verified": found.verified,
        "execution": found.duration,
        "planning": spent,
        "improvements": found.improvements,
        "bound": found.lower_bound,
    }


def searching(problem: op.Problem, budget: float, exact: float) -> TourSearch:
    """Return a search of a problem's only tour."""
    step = problem.task[0]
    assert isinstance(step.action, TargetTour)
    stage = Stages(problem).at(WorldState(problem.start, problem.scene), step, step.action.joints)
    planner = make_planner("trajopt", {})
    quiet = lambda *_: None  # noqa: E731
    time = Budget(budget)
    return TourSearch(stage.problem, step.action, stage.model, planner, time, quiet, quiet, time, exact=exact)


def joint_distances(problem: op.Problem) -> float | None:
    """Return the execution, s, with one configuration a hole and OR-Tools' order for their joint distances."""
    search = searching(problem, 100.0, 0.0)
    layers = search.vertices.first(search.budget, TURNS)
    assert isinstance(layers, list)
    soonest = [layer.Q[[search.ladder.times.between(problem.start[None], layer.Q)[0].argmin()]] for layer in layers]
    alone = [search.vertices.layer(Q) for Q in soonest]
    Q = np.concatenate([problem.start[None], *soonest])
    far = np.abs(Q[:, None] - Q[None]).max(axis=2)
    order = OrderSearch(search.tour).improved(far, None, 200, 5.0)
    if order is not None:
        search.offer(alone, search.ladder.cheapest(alone, order))
    return None if search.best is None else search.best.seconds


def sizes(arguments: Any) -> tuple[tuple[str, ...], list[list[str]], list[dict[str, Any]]]:
    """Return the table of the published subsets."""
    published = yaml.safe_load((AIRBUS / "published.yaml").read_text())["methods"]
    named = {one["name"]: one for one in published}
    headings = (
        "holes",
        "best published, s",
        "RoboTSP: planning / execution, s",
        "TSP in joint space",
        "joint distances, our motions, s",
        "execution, s",
        "planning, s of a core",
        "with limits of jerk, s",
        "planning, s of a core ",
    )
    rows, runs = [], []
    for k, count in enumerate(SIZES):
        if count not in arguments.sizes:
            continue
        free = planned(airbus(holes(count), jerk=False), arguments.budget)
        smooth = planned(airbus(holes(count), jerk=True), 2.0 * arguments.budget)  # whose proof takes twice as long
        plain = joint_distances(airbus(holes(count), jerk=False))
        pairs = [
            f"{one['cpu_time'][k]:.1f} / {one['execution_time'][k]:.1f}".replace("inf", "–")
            for one in (named["RoboTSP"], named["TSP in joint space"])
        ]
        rows.append(
            [
                str(count),
                f"{BEST[k]:.1f}",
                *pairs,
                "–" if plain is None else f"{plain:.1f}",
                *(text for one in (free, smooth) for text in _cells(one)),
            ]
        )
        runs.append({"holes": count, "without": free, "with": smooth, "joint_distances": plain})
    return headings, rows, runs


def growth(arguments: Any) -> tuple[tuple[str, ...], list[list[str]], list[dict[str, Any]]]:
    """Return the table of larger and larger tours."""
    headings = ("targets", "execution, s", "planning, s of a core")
    runs = [
        {"targets": count, **planned(airbus(spread(count), jerk=False), arguments.budget * max(1.0, count / 245))}
        for count in GROWTH
    ]
    return headings, [[str(one["targets"]), *_cells(one)] for one in runs], runs


def optimality(arguments: Any) -> tuple[tuple[str, ...], list[list[str]], list[dict[str, Any]]]:
    """Return the table of small tours, over the same configurations: local search beside the best of all orders."""
    headings = ("targets", "best of all orders, s", "local search, s", "gap")
    rows, runs = [], []
    for count in FEW:
        problem = airbus(holes(25)[:count], jerk=False)
        seconds = []
        for exact in (np.inf, 0.0):
            search = searching(problem, 600.0, exact)
            search.settling = 1000  # until all legs of the tour are free, or known not to be
            layers = search.vertices.first(search.budget, FEW_TURNS)
            assert isinstance(layers, list)
            first = search.first(layers)
            assert isinstance(first, Choice)
            seconds.append(search.improved(layers, first).seconds)
        rows.append([str(count), *(f"{s:.3f}" for s in seconds), f"{100.0 * (seconds[1] / seconds[0] - 1.0):.2f} %"])
        runs.append({"targets": count, "exact": seconds[0], "local": seconds[1]})
    return headings, rows, runs


def _cells(one: dict[str, Any]) -> list[str]:
    return [f"{one['execution']:.1f}", f"{one['planning']:.1f}"] if one["verified"] else ["not verified", "–"]


def main() -> None:
    """Plan the tours and print the table; budgets count the processor's time, so that another load hardly shows."""
    base.clock = time.process_time
    parser = table_parser(__doc__)
    parser.add_argument("sizes", nargs="*", type=int, default=list(SIZES), help="numbers of holes")
    parser.add_argument(
        "--budget",
        type=float,
        default=8.0,
        help="s, of each tour, twice that with limits of jerk; the last proofs come after it",
    )
    parser.add_argument("--growth", action="store_true", help="more and more targets instead")
    parser.add_argument("--optimality", action="store_true", help="few targets instead, beside the best of all orders")
    arguments = parser.parse_args()
    table = growth if arguments.growth else optimality if arguments.optimality else sizes
    headings, rows, runs = table(arguments)
    finish(arguments.markdown, headings, rows, {"budget": arguments.budget, "runs": runs})


if __name__ == "__main__":
    main()
