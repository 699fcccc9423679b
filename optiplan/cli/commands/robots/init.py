"""`optiplan robots init`: from a URDF, or a robot of another program, to a robot.yaml and its SRDF."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from optiplan.cli.options import AsJson
from optiplan.cli.output import stdout_is_ours

SOURCE = "a URDF, a xacro file, MuJoCo's MJCF, a USD stage, or a MoveIt configuration folder"


def init(
    context: typer.Context,
    urdf: Annotated[Path, typer.Argument(metavar="URDF", help=SOURCE)],
    out: Annotated[
        Path | None, typer.Option("--out", metavar="DIR", help="folder for the files (default: the source's)")
    ] = None,
    name: Annotated[
        str | None, typer.Option("--name", metavar="NAME", help="of the robot (default: the source's)")
    ] = None,
    group: Annotated[str | None, typer.Option("--group", metavar="J1,J2,…", help="joints to plan")] = None,
    tool: Annotated[str | None, typer.Option("--tool", metavar="FRAME", help="the frame that goals are for")] = None,
    lock: Annotated[
        list[str] | None, typer.Option("--lock", metavar="JOINT=Q", help="position of a joint that is not planned")
    ] = None,
    limit: Annotated[
        list[str] | None, typer.Option("--limit", metavar="KEY=X", help="a limit of all joints, such as acceleration=5")
    ] = None,
    allow_pairs: Annotated[
        str | None,
        typer.Option(
            "--allow-pairs", metavar="PAIRS", help="pairs of links not to check: `touching` (often), or A:B,C:D,…"
        ),
    ] = None,
    arg: Annotated[
        list[str] | None, typer.Option("--arg", metavar="NAME=VALUE", help="an argument of a xacro file (repeatable)")
    ] = None,
    full: Annotated[bool, typer.Option("--full", help="print every pair of links and every frame")] = False,
    force: Annotated[bool, typer.Option("--force", help="replace files that are there")] = False,
    ask: Annotated[bool | None, typer.Option("--ask/--no-ask", help="ask for what no flag says")] = None,
    as_json: AsJson = False,
) -> int:
    """Make a robot from a URDF: choose the joints to plan, find the pairs of links that need no check, write both.

    On a terminal it asks for what no flag says; a plain Enter takes what stands in brackets.
    Robots of MuJoCo, USD, MoveIt and xacro are written as robot.urdf, those of MuJoCo and USD with their meshes. The
    head of robot.yaml says what was left out.

    [bold]Examples[/]

      optiplan robots init my_arm.urdf

      optiplan robots init my_arm.urdf --allow-pairs touching   links that overlap as they are built

      optiplan robots init panda.xml --out panda                MuJoCo's MJCF (package mujoco)

      optiplan robots init ur.urdf.xacro --arg ur_type=ur5e --out ur5e   xacro (package xacro)

      optiplan robots init arm.usda --out arm                   UsdPhysics (package usd-core)

      optiplan robots init panda_moveit_config --out panda      groups, states, pairs and limits of MoveIt

      optiplan robots init my_arm.urdf --group j1,j2,j3 --tool tool0 --lock finger=0.02 --limit acceleration=5
    """
    from optiplan.api.imports import robot_files
    from optiplan.api.init_robot import TOUCHING, prepare
    from optiplan.cli.commands.robots import wizard
    from optiplan.cli.commands.robots.mesh_covers import make_covers
    from optiplan.cli.progress import ProgressLog
    from optiplan.files import folder_of
    from optiplan.importers.robots.describe import describe

    as_json = as_json or bool(context.obj)
    folder = folder_of(urdf) if out is None else out
    robot_files.refuse_files(folder, force)
    choices = wizard.read_choices(group or "", tool or "", lock or [], limit or [], allow_pairs or "")
    with stdout_is_ours():
        read = describe(urdf, wizard.read_arguments(arg or []))
        robot_files.refuse_files(folder, force, read)
        with robot_files.laid_out(read, name) as source:
            with ProgressLog() as progress:
                make_covers(source, progress)
            if sys.stdin.isatty() and not as_json if ask is None else ask:
                choices = wizard.ask(source.load, choices)
            with ProgressLog() as progress:
                robot, choices = prepare(source, choices, allow_pairs == TOUCHING, progress)
            notes = robot_files.write_robot(source, folder, robot, choices)
    wizard.show(robot, folder, as_json, full, notes)
    return 0
