"""Print the summary of `optiplan bench`: one line a planner."""

from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from optiplan.bench.execution.runner import Summary
from optiplan.bench.results.best_known import Standing
from optiplan.bench.results.database import Store

SHARES = """
SELECT planners.label AS planner, count(*) AS runs, avg(planned) AS planned, avg(timed) AS timed,
    avg(verified) AS verified
FROM runs JOIN planners ON planners.label = runs.planner GROUP BY planners.label ORDER BY planners.position
"""
MEDIAN = """
SELECT avg(value) AS median FROM (
    SELECT {column} AS value, row_number() OVER (ORDER BY {column}) AS place, count(*) OVER () AS size
    FROM rated WHERE planner = ? AND verified AND {column} IS NOT NULL)
WHERE place IN ((size + 1) / 2, (size + 2) / 2)
"""
FAILURES = "SELECT failure_kind, count(*) AS runs FROM runs WHERE failure_kind IS NOT NULL GROUP BY 1 ORDER BY 2 DESC"


def summary_data(store: Store, done: Summary, standing: Standing | None = None) -> dict[str, Any]:
    """JSON-ready: counts, shares and medians (over verified runs) by planner, failures by kind."""
    planners = {}
    for row in store.query(SHARES):
        medians = {name: _median(store, row["planner"], name) for name in ("plan_time", "plan_cpu", "ratio")}
        planners[row["planner"]] = {key: row[key] for key in row.keys() if key != "planner"} | medians
    if standing is not None:
        for label, numbers in planners.items():
            ratio = standing.ratio.get(label)
            numbers["over_best_known"] = None if ratio is None else float(np.median(ratio))
    beaten = {} if standing is None else {"best_known": {"new": standing.new, "beaten": standing.beaten}}
    return {
        "results": str(store.path),
        "runs": done.total,
        "found": done.found,
        "made": done.made,
        "complete": done.complete,
        "planners": planners,
        "failures": {row["failure_kind"]: row["runs"] for row in store.query(FAILURES)},
        **beaten,
    }


def show_summary(console: Console, store: Store, done: Summary, standing: Standing | None = None) -> None:
    """Print the summary as a table."""
    data = summary_data(store, done, standing)
    table = Table(box=None, pad_edge=False)
    figures = ["plan_time", "plan_cpu", "ratio", *([] if standing is None else ["over_best_known"])]
    titles = ("plan s, median", "processor s", "/ bound, median", "/ best known")[: len(figures)]
    for name in ("planner", "runs", "planned", "timed", "verified", *titles):
        table.add_column(name, justify="left" if name == "planner" else "right", overflow="fold")
    for name, row in data["planners"].items():
        shares = [f"{100 * row[key]:.1f} %" for key in ("planned", "timed", "verified")]
        medians = ["–" if row[key] is None else f"{row[key]:.3f}" for key in figures]
        table.add_row(name, str(row["runs"]), *shares, *medians)
    console.print(table)
    for kind, count in data["failures"].items():
        console.print(f"{count} × {kind}", markup=False)
    if standing is not None:
        console.print(
            f"best known durations: {standing.beaten} beaten, {standing.new} new of {standing.known} problems"
        )
    console.print(f"{done.found + done.made} of {done.total} runs in {store.path}", markup=False, soft_wrap=True)


def _median(store: Store, planner: str, column: str) -> float | None:
    value: float | None = store.query(MEDIAN.format(column=column), (planner,))[0]["median"]
    return value
