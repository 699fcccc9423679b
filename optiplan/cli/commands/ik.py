"""`optiplan ik`: the configurations that put a robot's tool at a pose."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from optiplan.cli.options import AsJson, Frame, Group, RobotName, numbers
from optiplan.cli.output import Exit, print_json, results, stdout_is_ours

_EXPECTED = {
    "--pose": "six numbers with commas between them: X,Y,Z,ROLL,PITCH,YAW",
    "--quaternion": "seven numbers with commas between them: X,Y,Z,QX,QY,QZ,QW",
    "--matrix": "12 or 16 numbers, row by row, with commas between them, or a file of them",
}
_COUNTS = {"--pose": (6,), "--quaternion": (7,), "--matrix": (12, 16)}
_LARGEST = 10_000
"""Bytes of a file with a matrix."""


Pose = Annotated[
    str | None, typer.Option(metavar="X,Y,Z,ROLL,PITCH,YAW", help="of the frame, in the robot's base frame")
]
Quaternion = Annotated[
    str | None, typer.Option(metavar="X,Y,Z,QX,QY,QZ,QW", help="instead: position and unit quaternion")
]
Matrix = Annotated[str | None, typer.Option(metavar="R11,R12,…|FILE", help="instead: 4×4 or 3×4 matrix, row by row")]
Every = Annotated[bool, typer.Option("--all", help="every branch, also those that violate joint limits")]


def ik(
    robot: RobotName,
    pose: Pose = None,
    quaternion: Quaternion = None,
    matrix: Matrix = None,
    frame: Frame = None,
    group: Group = None,
    every: Every = False,
    as_json: AsJson = False,
) -> int:
    """Find the joint values that put the robot's tool at a pose; collisions are not checked.

    The pose is in metres and radians; roll, pitch and yaw turn about the [bold]fixed[/] axes x, then y, then z. A
    quaternion is x, y, z, w, the scalar last, as in problem files. A matrix is 16 numbers, or 12 without the last row,
    or a file with them; a rotation with few digits is replaced by the nearest one.
    Arms with a spherical wrist and arms with three parallel axes (SRRA, PUMA 560, UR …) are solved in closed form: all
    of up to eight branches, each with a name. For other robots many starts are tried, and the branch is "numeric".
    Without --all: the solution within limits nearest to the configuration `ready` (else to the first
    that the robot file names, else to zero).

    [bold]Examples[/]

      optiplan ik ur5 --pose 0.4,0.2,0.3,3.1416,0,0

      optiplan ik srra --pose 0.8,0.3,0.5,0,1.57,0 --all

      optiplan ik puma560 --matrix 1,0,0,0.4,0,-1,0,0.2,0,0,-1,0.67183

      optiplan ik delbot --group arm --pose 0.36,-0.11,0.54,3.14,0,-1.57 --json

    With --json: `solutions` holds `q`, `branch`, `within_limits`, `error` (m or rad, the larger), `singular`, and
    `images`: for each joint all values within its limits that differ by whole turns; every combination is a solution.

    Exit code: 0 solved · 2 bad input · 3 no solution within joint limits: `reason` and `nearest` say why and how close.
    """
    from optiplan.cli.printing.ik_table import describe, show
    from optiplan.kinematics.ik.solve import answer, wanted_configuration
    from optiplan.robot.robot import load_robot

    X_WG = _goal({"--pose": pose, "--quaternion": quaternion, "--matrix": matrix})
    with stdout_is_ours():
        loaded = load_robot(robot, group=group)
        name = frame or loaded.tool_frame
        loaded.frame_id(name)
        found = answer(loaded, name, X_WG, wanted_configuration(loaded))
    code = Exit.NO_PLAN if found.nearest else 0
    data = describe(loaded, name, found, every) | {"exit_code": int(code)}
    if as_json:
        print_json(data)
    else:
        show(results(), data)
    return int(code)


def _goal(options: Mapping[str, str | None]) -> Any:
    """Return the one pose given, a `pinocchio.SE3`.

    Raises:
        BadParameter: no pose or several, a wrong number of values, or not a rotation.
    """
    from optiplan.geometry.poses import pose_from_data, pose_from_matrix

    given = [(option, text) for option, text in options.items() if text is not None]
    if len(given) != 1:
        found = " and ".join(option for option, _ in given) or "none"
        raise typer.BadParameter(f"found {found}; expected one of {', '.join(options)}", param_hint="'--pose'")
    ((option, text),) = given
    values = numbers(text) if option != "--matrix" or "," in text else _numbers_of_file(text)
    if len(values) not in _COUNTS[option]:
        raise typer.BadParameter(f"'{text}'; expected {_EXPECTED[option]}", param_hint=f"'{option}'")
    try:
        if option == "--matrix":
            return pose_from_matrix(values)
        return pose_from_data({"position": values[:3], "rpy" if option == "--pose" else "quaternion": values[3:]})
    except ValueError as error:
        raise typer.BadParameter(str(error), param_hint=f"'{option}'") from error


def _numbers_of_file(name: str) -> list[float]:
    """Read numbers of a file, separated by commas, semicolons, brackets or space; empty also without a file."""
    from optiplan.files import is_file, read_bytes

    if not is_file(Path(name)):
        return []
    text = read_bytes(Path(name), _LARGEST).decode("utf-8", errors="replace")
    return numbers(",".join(re.sub(r"[,;\[\]]", " ", text).split()))
