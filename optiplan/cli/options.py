"""Arguments and options that several commands share."""

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
