"""`optiplan import`: problems of other programs as problem files."""

from contextlib import nullcontext
from pathlib import Path
from typing import Annotated

import typer

from optiplan.cli.options import AsJson
from optiplan.cli.output import messages, print_json, say, stdout_is_ours
from optiplan.errors import counted

app = typer.Typer()
LISTED = 20
"""Skipped files that are named on the terminal; --json names all."""


@app.callback()
def importing() -> None:
    """Turn problems of other programs into problem files."""


@app.command("mbm")
def mbm(
    directory: Annotated[Path, typer.Argument(metavar="DIR", help="folder with scene*.yaml and request*.yaml below")],
    out: Annotated[Path, typer.Argument(metavar="OUT", help="folder for the problem files, one folder a set")],
    robot: Annotated[
        str | None, typer.Option(metavar="NAME_OR_FILE", help="default: the robot_model_name of each scene")
    ] = None,
    as_json: AsJson = False,
) -> int:
    """Turn MotionBenchMaker sets (MoveIt scenes and requests) into problem files.

    Joints outside the group are locked where the request puts them, even beyond their own limits; a note says so.

    [bold]Example[/]

      optiplan import mbm problems/bookshelf_small_panda out --robot panda
    """
    from optiplan.importers.motion_bench_maker import import_mbm

    with stdout_is_ours():
        done = import_mbm(directory, out, robot)
    if as_json:
        skipped = [{"file": str(path), "reason": reason} for path, reason in done.skipped]
        print_json({"written": [str(path) for path in done.written], "skipped": skipped, "notes": dict(done.notes)})
        return 0
    for path, reason in done.skipped[:LISTED]:
        messages().print(f"skipped {path}: {reason}", style="yellow", markup=False, soft_wrap=True)
    if len(done.skipped) > LISTED:
        messages().print(f"… and {len(done.skipped) - LISTED} more (--json names all)", style="yellow")
    for note, count in done.notes:
        messages().print(f"note ({count} problems): {note}", style="yellow", markup=False, soft_wrap=True)
    say(f"{len(done.written)} problems written to {out}")
    return 0


@app.command("scene")
def scene(
    source: Annotated[
        Path, typer.Argument(metavar="FILE", help="a .scene of MoveIt, an SDF file, MuJoCo's MJCF, or a USD stage")
    ],
    out: Annotated[Path, typer.Argument(metavar="OUT", help="the problem file to write; meshes go beside it")],
    robot: Annotated[str, typer.Option("--robot", metavar="NAME_OR_FILE", help="the robot, at the scene's origin")],
    force: Annotated[bool, typer.Option("--force", help="replace files that are there")] = False,
    as_json: AsJson = False,
) -> int:
    """Turn a scene of another program into a problem file, whose start and goal are to be edited.

    The head of the file says what was left out.

    [bold]Examples[/]

      optiplan import scene cell.sdf cell.yaml --robot panda

      optiplan import scene shelf.scene shelf.yaml --robot my/robot.yaml
    """
    from optiplan.api.imports.scenes import write_scene
    from optiplan.importers.scenes.read import read_scene

    with stdout_is_ours():
        read = read_scene(source)
        write_scene(read, out, robot, force, nullcontext())
    if as_json:
        print_json(
            {"written": str(out), "obstacles": len(read.obstacles), "meshes": len(read.files), "notes": read.notes}
        )
        return 0
    for note in read.notes:
        messages().print(f"note: {note}", style="yellow", markup=False, soft_wrap=True)
    say(f"written to {out}: {counted(len(read.obstacles), 'obstacle')}")
    return 0
