"""`optiplan planners`: who can plan, and what can be set."""

from typing import Annotated

import typer

from optiplan.cli.output import print_json, results


def planners(
    as_json: Annotated[bool, typer.Option("--json", help="print one JSON object and nothing else")] = False,
) -> int:
    """List the planners with their options and defaults.

    Choose one with `--planner NAME`, or in the problem file with its options: `planner: {name: trajopt, spans: 24}`.
    """
    from rich.table import Table

    from optiplan.planners.registry import PLANNERS

    found = {name: (entry.summary, entry.option_list()) for name, entry in PLANNERS.items()}
    if as_json:
        rows = {
            name: {"summary": summary, "options": [vars(option) for option in options]}
            for name, (summary, options) in found.items()
        }
        print_json({"planners": rows})
        return 0
    for name, (summary, options) in found.items():
        results().print(f"[bold]{name}[/]: {summary}")
        table = Table(box=None, pad_edge=False, show_header=False, padding=(0, 2, 0, 2))
        for option in options:
            table.add_row(option.name, option.kind, str(option.default))
        results().print(table)
    return 0
