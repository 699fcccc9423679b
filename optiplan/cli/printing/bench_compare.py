"""Print `optiplan bench compare`: a table, the significant changes in words, new and fixed failures."""

import math
from typing import Any

from rich.console import Console
from rich.table import Table

from optiplan.bench.statistics.compare import IMPROVEMENT, REGRESSION, Change, Comparison

LISTED = 20
"""Failures that are listed in words; --json has all."""

WIDTH = 118
"""Characters that the table needs; a narrower terminal wraps its lines."""

STYLES = {REGRESSION: "red", IMPROVEMENT: "green"}


def comparison_data(found: Comparison) -> dict[str, Any]:
    """Return JSON-ready data; unknown values are null."""
    names = ("problem", "planner", "seed", "repetition")
    lists = {"new_failures": found.new_failures, "fixed": found.fixed}
    return {
        "common": found.common,
        "notes": list(found.notes),
        "changes": [_change_data(change) for change in found.changes],
        "regressions": [words(change) for change in found.of(REGRESSION)],
        "improvements": [words(change) for change in found.of(IMPROVEMENT)],
        **{
            name: [dict(zip(names, key, strict=True)) | {"kind": kind} for key, kind in runs]
            for name, runs in lists.items()
        },
    }


def _change_data(change: Change) -> dict[str, Any]:
    data = change._asdict() | {"ratio": change.ratio.value, "ratio_low": change.ratio.low}
    data["ratio_high"] = change.ratio.high
    return {key: None if isinstance(value, float) and math.isnan(value) else value for key, value in data.items()}


def show_comparison(console: Console, found: Comparison) -> None:
    """Print a table of changes, then the significant ones in words, then failures."""
    for note in found.notes:
        console.print(f"note: {note}", style="yellow", markup=False, soft_wrap=True)
    table = Table(box=None, pad_edge=False)
    for name in ("planner", "quantity", "A", "B", "B / A", "95 %", "better", "worse", "p", "Holm", ""):
        table.add_column(name, justify="left" if name in ("planner", "quantity", "") else "right", no_wrap=True)
    for change in found.changes:
        table.add_row(*_row(change), style=STYLES.get(change.verdict))
    console.width = max(console.width, WIDTH)
    console.print(table, markup=False)
    console.print(
        f"{found.common} runs in common; Holm: p corrected for {len(found.changes)} comparisons", markup=False
    )
    for verdict in (REGRESSION, IMPROVEMENT):
        for change in found.of(verdict):
            console.print(f"{verdict}: {words(change)}", style=STYLES[verdict], markup=False, soft_wrap=True)
    for name, runs in (("new failure", found.new_failures), ("fixed", found.fixed)):
        for (problem, planner, seed, repetition), kind in runs[:LISTED]:
            text = f"{name}: {planner} on {problem}, seed {seed}, repetition {repetition} ({kind})"
            console.print(text, markup=False, soft_wrap=True)
        if len(runs) > LISTED:
            console.print(f"{name}: {len(runs) - LISTED} more (--json has all)", markup=False)


def words(change: Change) -> str:
    """Describe a change in a sentence."""
    sure = f"(p = {change.corrected:.2g}; {change.better} problems better, {change.worse} worse)"
    if change.quantity == "success":
        return f"{change.planner}: {100 * change.before:.1f} % verified before, {100 * change.after:.1f} % now {sure}"
    low, high = (f"{value:.3f}" for value in change.ratio[1:])
    return f"{change.planner}: {change.quantity} {change.ratio.value:.3f} times that of before [{low}, {high}] {sure}"


def _row(change: Change) -> list[str]:
    scale, form = (100.0, "{:.1f} %") if change.quantity == "success" else (1.0, "{:.3f} s")
    values = ["–" if math.isnan(x) else form.format(scale * x) for x in (change.before, change.after)]
    ratio = "–" if math.isnan(change.ratio.value) else f"{change.ratio.value:.3f}"
    spread = "–" if math.isnan(change.ratio.low) else f"{change.ratio.low:.3f} to {change.ratio.high:.3f}"
    counts = [str(change.better), str(change.worse), f"{change.p:.2g}", f"{change.corrected:.2g}"]
    verdict = change.verdict if change.verdict in STYLES else ""
    return [change.planner, change.quantity, *values, ratio, spread, *counts, verdict]
