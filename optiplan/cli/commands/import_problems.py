"""`optiplan import`: problems of other programs as problem files."""

from pathlib import Path
from typing import Annotated

import typer

from optiplan.cli.options import AsJson
from optiplan.cli.output import messages, print_json, say, stdout_is_ours

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
