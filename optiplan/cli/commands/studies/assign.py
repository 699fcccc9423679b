"""`optiplan assign`: jobs of an assembly given to arms."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from optiplan.cli.commands.studies import shown
from optiplan.cli.options import AsJson
from optiplan.cli.output import Exit, interruptible, plain_table, results, stdout_is_ours
from optiplan.cli.progress import ProgressLine

if TYPE_CHECKING:
    from optiplan.studies.assembly.result import Assignment

File = Annotated[Path, typer.Argument(metavar="FILE", help="assembly file (YAML)")]
Seconds = Annotated[float, typer.Option("--budget", min=0.1, metavar="S", help="seconds, half for the jobs alone")]
Out = Annotated[Path | None, typer.Option(metavar="DIR", help="write the problem and the run folder there")]


def assign(file: File, budget: Seconds = 120.0, out: Out = None, as_json: AsJson = False) -> int:
    """Find which arm does which job, and in which order, so that all are done soonest.

    Each job is planned alone by each arm. The schedules that are shortest by these durations are planned whole and
    proved. Ctrl-C ends the search and keeps the best motion proved so far.

    [bold]Examples[/]

      optiplan assign examples/assembly.yaml --out assembly      and view assembly/run

      optiplan assign assembly.yaml --budget 60

    Exit code: 0 verified · 2 bad input · 3 no arm can do a job, or nothing was verified · 130 interrupted.
    """
    from optiplan.api.studies.assigning import assign as search
    from optiplan.runs.run_folder import check_folder

    if out is not None:
        check_folder(out)
    with interruptible(), stdout_is_ours(), ProgressLine() as progress:
        found = search(file, budget=budget, progress=progress)
    code = int(Exit.INTERRUPTED) if found.ended == "interrupted" else int(0 if found.run is not None else Exit.NO_PLAN)
    return shown(found.data, lambda: _print(found), code, as_json, out, found.save)


def _print(found: "Assignment") -> None:
    """Print the jobs with their arms and times, and the result in a sentence."""
    if found.jobs:
        table = plain_table((), ("job", "arm", "begin, s", "end, s"))
        for one in found.jobs:
            table.add_row(one.job, one.arm, f"{one.begin:.3f}", f"{one.end:.3f}")
        results().print(table, markup=False)
    results().print(found.words, soft_wrap=True, markup=False)
