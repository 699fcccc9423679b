"""`optiplan control`: run a closed loop from a control file."""

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from optiplan.cli.completion import control_names
from optiplan.cli.options import AsJson
from optiplan.cli.output import Exit, results, saved, show_result, stdout_is_ours
from optiplan.cli.progress import ProgressLine
from optiplan.errors import InputError


def control(
    file: Annotated[
        str,
        typer.Argument(metavar="FILE", help="a control file, or the name of an example", autocompletion=control_names),
    ],
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="write the log folder there")] = None,
    as_json: AsJson = False,
) -> int:
    """Run a closed loop: a reference, a controller and a plant.

    The log folder holds the executed motion, the arrays over time and pictures of errors, limits and slack;
    `optiplan view DIR` plays it.

    [bold]Examples[/]

      optiplan control panda_shelf                       a bundled example

      optiplan control cell.yaml --out runs/cell

      optiplan view runs/cell

    Exit code: 0 ran to its end, nothing touched · 2 bad input · 3 no motion was found to follow
    · 4 bodies touched, the motion grew without bound, or a limit did not hold at its end.
    """
    from optiplan.cli.printing.control_log import show_simulation
    from optiplan.runs.run_folder import check_folder
    from optiplan.simulation.files.read import find_control
    from optiplan.simulation.simulation import run_control

    path = find_control(file)
    if out is not None:
        check_folder(out)
    with stdout_is_ours(), ProgressLine() as progress:
        done = run_control(path, lambda share: progress("simulating", share))
    code = Exit.VERIFIED if done.clean else Exit.NO_PLAN if done.log is None else Exit.NOT_VERIFIED
    unsaved: list[InputError] = []
    if out is not None:
        saved(partial(done.save, out), unsaved)
    there = None if unsaved else out
    return show_result(done.to_dict(), lambda: show_simulation(results(), done, there), code, as_json, unsaved)
