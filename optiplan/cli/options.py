"""Arguments and options that several commands share."""

import math
from collections.abc import Mapping
from typing import Annotated

import typer

from optiplan.cli.completion import robot_names
from optiplan.errors import OptiPlanError

AsJson = Annotated[bool, typer.Option("--json", help="print one JSON object and nothing else")]
Full = Annotated[bool, typer.Option("--full", help="every check, not only those that failed")]
RobotName = Annotated[
    str,
    typer.Argument(metavar="ROBOT", help="a name of `optiplan robots`, or a robot.yaml", autocompletion=robot_names),
]
Frame = Annotated[str | None, typer.Option(metavar="NAME", help="frame (default: the robot's tool frame)")]
Group = Annotated[str | None, typer.Option(metavar="NAME", help="the joints that move; see: robots show")]


Port = Annotated[
    int | None, typer.Option(min=0, max=65535, metavar="N", help="first port to try (default: 7000); 0: any")
]


def refuse(given: Mapping[str, object], why: str) -> None:
    """Refuse the first of these options that is given, one that is not None, where it has no effect.

    Raises:
        typer.BadParameter: names the option and says why.
    """
    if wrong := [option for option, value in given.items() if value is not None]:
        raise typer.BadParameter(why, param_hint=wrong[0])


def listed(text: str) -> tuple[str, ...]:
    """Return the words between commas, each once.

    Raises:
        OptiPlanError: one is empty.
    """
    found = tuple(dict.fromkeys(word.strip() for word in text.split(",")))
    if "" in found:
        raise OptiPlanError(f"found an empty name in '{text}'; expected names with one comma between two")
    return found


def numbers(text: str) -> list[float]:
    """Parse numbers separated by commas; empty if one of them is not finite, or not a number."""
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        return []
    return values if all(map(math.isfinite, values)) else []
