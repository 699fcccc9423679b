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

    return 0
