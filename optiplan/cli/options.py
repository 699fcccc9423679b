"""Arguments and options that several commands share."""

import math
from typing import Annotated

import typer

from optiplan.cli.completion import robot_names

AsJson = Annotated[bool, typer.Option("--json", help="print one JSON object and nothing else")]
Full = Annotated[bool, typer.Option("--full", help="every check, not only those that failed")]
RobotName = Annotated[
    str,
    typer.Argument(metavar="ROBOT", help="a name of `optiplan robots`, or a robot.yaml", autocompletion=robot_names),
]
Frame = Annotated[str | None, typer.Option(metavar="NAME", help="frame (default: the robot's tool frame)")]
Group = Annotated[str | None, typer.Option(metavar="NAME", help="the joints that move; see: robots show")]


def numbers(text: str) -> list[float]:
    """Parse numbers separated by commas; empty if one of them is not finite, or not a number."""
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        return []
    return values if all(map(math.isfinite, values)) else []
