"""Print the summary of `optiplan bench`: one line a planner."""

from typing import Any

from rich.console import Console
from rich.table import Table

from optiplan.bench.execution.runner import Summary
from optiplan.bench.results.best_known import Standing
from optiplan.bench.results.database import Store
from optiplan.bench.results.summary import failure_counts, planner_numbers, planner_table


def summary_data(store: Store, done: Summary, standing: Standing | None = None) -> dict[str, Any]:
    """JSON-ready: counts, shares and medians (over verified runs) by planner, failures by kind."""
    beaten = {} if standing is None else {"best_known": {"new": standing.new, "beaten": standing.beaten}}
    return {
        "results": str(store.path),
        "runs": done.total,
        "found": done.found,
        "made": done.made,
        "complete": done.complete,
        "planners": planner_numbers(store, standing),
        "failures": failure_counts(store),
        **beaten,
    }


def show_summary(console: Console, store: Store, done: Summary, standing: Standing | None = None) -> None:
    """Print the summary as a table."""
    data = summary_data(store, done, standing)
    titles, *rows = planner_table(data["planners"])
    table = Table(box=None, pad_edge=False)
    for name in titles:
        table.add_column(name, justify="left" if name == "planner" else "right", overflow="fold")
    for row in rows:
        table.add_row(*row)
    console.print(table, markup=False)
    for kind, count in data["failures"].items():
        console.print(f"{count} × {kind}", markup=False)
    if standing is not None:
        console.print(
            f"best known durations: {standing.beaten} beaten, {standing.new} new of {standing.known} problems"
        )
    console.print(f"{done.found + done.made} of {done.total} runs in {store.path}", markup=False, soft_wrap=True)
