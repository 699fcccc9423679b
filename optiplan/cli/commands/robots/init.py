"""`optiplan robots init`: from a URDF to a robot.yaml and the SRDF of the pairs that need no check."""

import sys
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from optiplan.cli.options import AsJson
from optiplan.cli.output import stdout_is_ours


def init(
    context: typer.Context,
    urdf: Annotated[Path, typer.Argument(metavar="URDF", help="the robot's URDF")],
    out: Annotated[
        Path | None, typer.Option("--out", metavar="DIR", help="folder for the files (default: the URDF's)")
    ] = None,
    name: Annotated[
        str | None, typer.Option("--name", metavar="NAME", help="of the robot (default: the URDF's)")
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
    full: Annotated[bool, typer.Option("--full", help="print every pair of links and every frame")] = False,
    force: Annotated[bool, typer.Option("--force", help="replace files that are there")] = False,
    ask: Annotated[bool | None, typer.Option("--ask/--no-ask", help="ask for what no flag says")] = None,
    as_json: AsJson = False,
) -> int:
    """Make a robot from a URDF: choose the joints to plan, find the pairs of links that need no check, write both.

    On a terminal it asks for what no flag says; a plain Enter takes what stands in brackets.

    [bold]Examples[/]

      optiplan robots init my_arm.urdf

      optiplan robots init my_arm.urdf --allow-pairs touching   links that overlap as they are built

      optiplan robots init my_arm.urdf --group j1,j2,j3 --tool tool0 --lock finger=0.02 --limit acceleration=5
    """
    from optiplan.api import init_robot as robots
    from optiplan.cli.commands.robots import wizard
    from optiplan.cli.commands.robots.mesh_covers import make_covers
    from optiplan.cli.progress import ProgressLog

    as_json = as_json or bool(context.obj)
    folder = urdf.parent if out is None else out
    robots.refuse_files(folder, force)
    choices = wizard.read_choices(group or "", tool or "", lock or [], limit or [], allow_pairs or "")
    with stdout_is_ours():
        load = partial(robots.load_choices, urdf, name or robots.title_of(urdf))
        with ProgressLog() as progress:
            make_covers(urdf, progress)
        if sys.stdin.isatty() and not as_json if ask is None else ask:
            choices = wizard.ask(load, choices)
        with ProgressLog() as progress:
            robot, choices = robots.prepare(load, choices, allow_pairs == robots.TOUCHING, progress)
    robots.write_robot(urdf, folder, robot, choices)
    wizard.show(robot, folder, as_json, full)
    return 0
