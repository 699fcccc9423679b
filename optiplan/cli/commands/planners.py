"""`optiplan planners`: list planners and their options."""

from collections.abc import Sequence
from textwrap import fill
from typing import Annotated, Any

import typer
from rich.markup import escape
from rich.table import Table

from optiplan.cli.completion import planner_names
from optiplan.cli.options import AsJson
from optiplan.cli.output import print_json, results


def planners(
    names: Annotated[
        list[str] | None,
        typer.Argument(metavar="NAME…", help="show the options of these planners", autocompletion=planner_names),
    ] = None,
    as_json: AsJson = False,
) -> int:
    """List the planners, or show the options of some with their defaults.

    Choose one with `--planner NAME`, or in the problem file with its options: `planner: {name: trajopt, spans: 24}`.

    [bold]Examples[/]

      optiplan planners

      optiplan planners trajopt rrtconnect       their options

      optiplan planners my_package:MyPlanner     those of a planner of your own
    """
    from optiplan.planners.registry import PLANNERS, planner_entry

    entries = [planner_entry(name) for name in names or PLANNERS]
    if as_json:
        rows = {
            entry.name: {
                "family": entry.family,
                "summary": entry.summary,
                "options": [vars(option) for option in entry.option_list()],
            }
            for entry in entries
        }
        print_json({"planners": rows})
    elif names:
        for entry in entries:
            _print_options(entry)
    else:
        _print_list(entries)
    return 0


def _print_list(entries: Sequence[Any]) -> None:
    """Name and summary of the planners, by family."""
    from optiplan.planners.registry import FAMILIES

    width = 2 + max(len(entry.name) for entry in entries)
    for family in FAMILIES:
        results().print(f"[dim]{family}[/]")
        table = Table.grid(padding=(0, 2))
        table.add_column(no_wrap=True, min_width=width)
        table.add_column(overflow="fold")
        for entry in entries:
            if entry.family == family:
                table.add_row(f"  [bold]{entry.name}[/]", escape(entry.summary))
        results().print(table)
    results().print("\noptions of a planner: optiplan planners NAME")


def _print_options(entry: Any) -> None:
    """Summary of a planner, then name, type, default and meaning of each option."""
    console, indent = results(), 6 * " "
    console.print(f"[bold]{escape(entry.name)}[/]: {escape(entry.summary)}")
    for option in entry.option_list():
        console.print(f"  [bold]{option.name}[/]: {escape(option.kind)}, default {escape(_yaml(option.default))}")
        meaning = fill(option.meaning, console.width, initial_indent=indent, subsequent_indent=indent)
        console.print(meaning, markup=False)


def _yaml(value: Any) -> str:
    """Return a default as in a problem file."""
    if value is None:
        return "none"
    if isinstance(value, bool):
        return str(value).lower()
    return str(list(value)) if isinstance(value, tuple) else str(value)
