"""`optiplan planners`: list planners and their options."""

from collections.abc import Sequence
from typing import Annotated, Any

import typer
from rich.markup import escape
from rich.table import Table

from optiplan.cli.output import print_json, results


def planners(
    as_json: Annotated[bool, typer.Option("--json", help="print one JSON object and nothing else")] = False,
) -> int:
    """List the planners with their options and defaults.

    Choose one with `--planner NAME`, or in the problem file with its options: `planner: {name: trajopt, spans: 24}`.
    """
    from optiplan.planners.registry import FAMILIES, PLANNERS

    found = {name: (entry, entry.option_list()) for name, entry in PLANNERS.items()}
    if as_json:
        rows = {
            name: {
                "family": entry.family,
                "summary": entry.summary,
                "options": [vars(option) for option in options],
            }
            for name, (entry, options) in found.items()
        }
        print_json({"planners": rows})
        return 0
    for family in FAMILIES:
        results().print(f"[dim]{family}[/]")
        for name, (entry, options) in found.items():
            if entry.family == family:
                results().print(f"[bold]{name}[/]: {escape(entry.summary)}")
                results().print(_table(options))
    return 0


def _table(options: Sequence[Any]) -> Table:
    """Name, type, default and meaning of each option."""
    table = Table(box=None, show_header=False, padding=(0, 2, 0, 2))
    for column in ("name", "kind", "default"):
        table.add_column(column, no_wrap=column != "kind")
    table.add_column("meaning", ratio=1, overflow="fold")
    for option in options:
        table.add_row(option.name, option.kind, _yaml(option.default), escape(option.meaning))
    return table


def _yaml(value: Any) -> str:
    """Return a default as in a problem file."""
    if value is None:
        return "not given"
    if isinstance(value, bool):
        return str(value).lower()
    return str(list(value)) if isinstance(value, tuple) else str(value)
