"""`optiplan place`: where a robot should stand to do a task, and do it fastest."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from optiplan.cli.commands.studies import shown
from optiplan.cli.completion import problem_names
from optiplan.cli.options import AsJson, RobotName
from optiplan.cli.output import Exit, plain_table, results, say, stdout_is_ours
from optiplan.cli.progress import ProgressLine
from optiplan.errors import errors_about

if TYPE_CHECKING:
    from optiplan.api.studies.placing import Placement

Task = Annotated[
    str,
    typer.Argument(metavar="TASK", help="problem file, or name of an example", autocompletion=problem_names),
]
Metres = Annotated[float, typer.Option(min=0.0, max=100.0, metavar="M", help="how far the base may be moved, m")]
Turn = Annotated[float, typer.Option(min=0.0, max=180.0, metavar="DEG", help="how far it may be turned either way")]
Points = Annotated[int, typer.Option(min=2, max=101, metavar="K", help="of the map, along x and y each")]
Seconds = Annotated[float, typer.Option("--budget", min=0.1, metavar="S", help="seconds, half of them for the map")]
Out = Annotated[Path | None, typer.Option(metavar="DIR", help="write the map, a page and the problem there")]


def place(
    robot: RobotName,
    task: Task,
    x: Metres = 0.4,
    y: Metres = 0.4,
    z: Metres = 0.0,
    yaw: Turn = 90.0,
    points: Points = 9,
    budget: Seconds = 60.0,
    out: Out = None,
    as_json: AsJson = False,
) -> int:
    """Find the base pose at which a robot can do a task, and does it fastest.

    Base poses around the one in the file are scored on a map; the best ones are planned and proved. Another robot than
    the file's starts in its own configuration. Several robots side by side are not placed.

    [bold]Examples[/]

      optiplan place panda 45_spot_tour --out place      and open place/place.html

      optiplan place ur5 task.yaml --x 0.2 --y 0.5 --z 0.3 --yaw 0

    Exit code: 0 a verified motion was found · 2 bad input · 3 none was.
    """
    from math import radians

    from optiplan.api.loading import load_problem
    from optiplan.api.studies.placing import RESULT
    from optiplan.api.studies.placing import place as search
    from optiplan.planners.tours.placing import PlaceRange

    if out is not None:
        RESULT.check(out)
    with stdout_is_ours(), ProgressLine() as progress:
        problem = load_problem(task)
        where = PlaceRange(x, y, z, radians(yaw), points)
        with errors_about("op.place", task):
            found = search(problem, robot, where, budget=budget, progress=progress)
    code = int(Exit.NO_PLAN if found.run is None else 0)
    return shown(_data(found), lambda: _print(found), code, as_json, out, found.save)


def _print(found: "Placement") -> None:
    """Print the bases that were planned, why some are not verified, and the result in a sentence."""
    table = plain_table((), ("base moved by x, m", "y, m", "z, m", "yaw, rad", "duration, s", "verified"))
    for moved, run in found.planned:
        duration = "–" if run.duration is None else f"{run.duration:.3f}"
        verified = "yes" if run.verified else "no"
        table.add_row(*(f"{value:.3f}" for value in moved), duration, verified)
    results().print(table, markup=False)
    for moved, why in found.unverified:
        x, y, z, yaw = moved
        say(f"not verified at x {x:.3f} m, y {y:.3f} m, z {z:.3f} m, yaw {yaw:.3f} rad: {why}", style="red")
    results().print(found.words, soft_wrap=True)


def _data(found: "Placement") -> dict[str, Any]:
    """Return the `--json` output; m, rad and s."""
    return {
        "robot": found.problem.robot.name,
        "problem": found.problem.name,
        "moved": found.moved,
        "base": found.base,
        "duration": None if found.run is None else found.run.duration,
        "given": found.given.duration if found.given.verified else None,
        "scored": len(found.scores.seconds),
        "planned": [
            {"moved": moved, "duration": run.duration, "verified": run.verified} for moved, run in found.planned
        ],
        "unverified": [{"moved": moved, "why": why} for moved, why in found.unverified],
    }
