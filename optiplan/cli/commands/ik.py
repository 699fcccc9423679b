"""`optiplan ik`: the configurations that put a robot's tool at a pose."""

import math
from typing import Annotated

import typer

from optiplan.cli.completion import robot_names
from optiplan.cli.output import Exit, print_json, results, stdout_is_ours

_EXPECTED = "six numbers with commas between them: X,Y,Z,ROLL,PITCH,YAW"


def _pose(text: str) -> str:
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError as error:
        raise typer.BadParameter(f"'{text}'; expected {_EXPECTED}") from error
    if len(values) != 6 or not all(map(math.isfinite, values)):
        raise typer.BadParameter(f"'{text}'; expected {_EXPECTED}")
    return text


def ik(
    robot: Annotated[
        str,
        typer.Argument(
            metavar="ROBOT", help="a name of `optiplan robots`, or a robot.yaml", autocompletion=robot_names
        ),
    ],
    pose: Annotated[
        str,
        typer.Option(callback=_pose, metavar="X,Y,Z,ROLL,PITCH,YAW", help="of the frame, in the robot's base frame"),
    ],
    frame: Annotated[
        str | None, typer.Option(metavar="NAME", help="which frame; the robot's tool frame if left out")
    ] = None,
    group: Annotated[str | None, typer.Option(metavar="NAME", help="the joints that move; see: robots show")] = None,
    every: Annotated[bool, typer.Option("--all", help="every branch, those that break joint limits too")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="print one JSON object and nothing else")] = False,
) -> int:
    """Find the joint values that put the robot's tool at a pose; collisions are not looked at.

    The pose is in metres and radians; roll, pitch and yaw turn about the [bold]fixed[/] axes x, then y, then z.
    Arms with a spherical wrist and arms with three parallel axes (SRRA, PUMA 560, UR …) are solved in closed form: all
    of up to eight branches, each with a name. For other robots many starts are tried, and the branch is "numeric".
    Without --all: the solution within limits nearest to the configuration `ready` (else to the first
    that the robot file names, else to zero).

    [bold]Examples[/]

      optiplan ik ur5 --pose 0.4,0.2,0.3,3.1416,0,0

      optiplan ik srra --pose 0.8,0.3,0.5,0,1.57,0 --all

      optiplan ik delbot --group arm --pose 0.36,-0.11,0.54,3.14,0,-1.57 --json

    With --json: `solutions` holds `q`, `branch`, `within_limits`, `error` (m or rad, the larger), `singular`, and
    `images`: for each joint all values within its limits that differ by whole turns; every combination is a solution.

    Exit code: 0 solved · 2 bad input · 3 no solution within joint limits: `reason` and `nearest` say why and how close.
    """
    from optiplan.cli.printing.ik_table import describe, show
    from optiplan.geometry.poses import pose_from_data
    from optiplan.kinematics.ik.solve import answer, wanted_configuration
    from optiplan.robot.robot import load_robot

    values = [float(part) for part in pose.split(",")]
    with stdout_is_ours():
        loaded = load_robot(robot, group=group)
        name = frame or loaded.tool_frame
        loaded.frame_id(name)
        X_WG = pose_from_data({"position": values[:3], "rpy": values[3:]})
        found = answer(loaded, name, X_WG, wanted_configuration(loaded))
    code = Exit.NO_PLAN if found.nearest else 0
    data = describe(loaded, name, found, every) | {"exit_code": int(code)}
    if as_json:
        print_json(data)
    else:
        show(results(), data)
    return int(code)
