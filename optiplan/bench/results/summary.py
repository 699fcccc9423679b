"""Counts, shares and medians of a suite's runs, by planner."""

import math
from typing import Any

import numpy as np

from optiplan.bench.results.arrays import load_runs
from optiplan.bench.results.best_known import Standing
from optiplan.bench.results.database import Store
from optiplan.bench.statistics.intervals_and_tests import median_of_known

FAILURES = "SELECT failure_kind, count(*) AS runs FROM runs WHERE failure_kind IS NOT NULL GROUP BY 1 ORDER BY 2 DESC"

_COUNTS = ("planner", "runs", "planned", "timed", "verified")
_MEDIANS = {
    "plan_time": "plan s, median",
    "plan_cpu": "processor s",
    "ratio": "/ bound, median",
    "over_best_known": "/ best known",
}
"""Medians by planner, and the titles of their columns."""


def planner_numbers(store: Store, standing: Standing | None = None) -> dict[str, dict[str, Any]]:
    """Return counts, shares and medians over verified runs by planner; with `standing` also over the best known."""
    runs, planners = load_runs(store), {}
    for k, label in enumerate(runs.planners):
        mine = runs.planner == k
        if not mine.any():
            continue
        numbers: dict[str, Any] = {"runs": int(mine.sum())}
        for name in ("planned", "timed", "verified"):
            numbers[name] = float(getattr(runs, name)[mine].mean())
        for name in ("plan_time", "plan_cpu", "ratio"):
            median = median_of_known(getattr(runs, name)[mine & runs.verified])
            numbers[name] = None if math.isnan(median) else median
        planners[label] = numbers
    if standing is not None:
        for label, numbers in planners.items():
            ratio = standing.ratio.get(label)
            numbers["over_best_known"] = None if ratio is None else float(np.median(ratio))
    return planners


def failure_counts(store: Store) -> dict[str, int]:
    """Return how many runs failed, by kind of failure, the most frequent first."""
    return {row["failure_kind"]: row["runs"] for row in store.query(FAILURES)}


def planner_table(planners: dict[str, dict[str, Any]]) -> list[list[str]]:
    """Return a table of text: the titles, then a row for each planner of `planner_numbers`."""
    figures = [name for name in _MEDIANS if all(name in row for row in planners.values())] if planners else []
    rows = [[*_COUNTS, *(_MEDIANS[name] for name in figures)]]
    for name, row in planners.items():
        shares = [f"{100 * row[key]:.1f} %" for key in ("planned", "timed", "verified")]
        medians = ["–" if row[key] is None else f"{row[key]:.3f}" for key in figures]
        rows.append([name, str(row["runs"]), *shares, *medians])
    return rows
