"""`optiplan design`: numbers of a robot chosen for what it has to do."""

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from optiplan.cli.commands.studies import shown
from optiplan.cli.options import AsJson
from optiplan.cli.output import Exit, interruptible, plain_table, results, stdout_is_ours, tell_interrupted
from optiplan.cli.progress import ProgressLine

if TYPE_CHECKING:
    from optiplan.studies.result import DesignResult

Study = Annotated[Path, typer.Argument(metavar="STUDY", help="study file (YAML)")]
Seconds = Annotated[
    float | None, typer.Option("--budget", min=0.1, metavar="S", help="s for the search (default: all generations)")
]
Out = Annotated[Path | None, typer.Option(metavar="DIR", help="write the page, the figure, CSV and the robot there")]

_SHOWN = 12
"""Designs of the front that the table has, evenly chosen."""


def design(study: Study, budget: Seconds = None, out: Out = None, as_json: AsJson = False) -> int:
    """Choose link lengths, masses and limits of a robot for what it has to do.

    Shows the best compromises between the objectives of the study. The given design, the middle one and the best in
    every objective are planned with in all tasks, and verified. Ctrl-C ends the search and keeps what was found;
    once more, and the chosen designs that are not planned yet are left out.

    [bold]Examples[/]

      optiplan design examples/design_srra.yaml --out design      and open design/design.html

      optiplan design study.yaml --budget 60

    Exit code: 0 there is a front · 2 bad input · 3 no design meets what is required · 130 interrupted.
    """
    from optiplan.api.studies.designing import RESULT, save_design
    from optiplan.api.studies.designing import design as search

    if out is not None:
        RESULT.check(out)
    try:
        with interruptible(), stdout_is_ours(), ProgressLine() as progress:
            found = search(study, budget=budget, progress=progress)
    except KeyboardInterrupt:
        return tell_interrupted("no design was measured", as_json)
    code = int(Exit.INTERRUPTED) if found.ended == "interrupted" else int(0 if found.front else Exit.NO_PLAN)
    return shown(found.data, lambda: _print(found), code, as_json, out, partial(save_design, found))


def _print(found: "DesignResult") -> None:
    """Print the front, what came of the chosen designs, and the result in a sentence."""
    names = [name for name, _ in found.columns]
    headings = [f"{name}, {unit}" if unit not in ("", "1") else name for name, unit in found.columns]
    roles = {id(proof.design): proof for proof in found.proofs}
    table = plain_table((), (*headings, "design"))
    front = found.front
    step = max(1, -(-len(front) // _SHOWN))
    some = [design for k, design in enumerate(front) if k % step == 0 or id(design) in roles]
    for design in [found.given, *(design for design in some if design is not found.given)]:
        proof, row = roles.get(id(design)), found.row(design)
        words = "" if proof is None else proof.role
        if proof is not None and found.study.tasks:
            seconds = "" if proof.cycle_time is None else f" in {proof.cycle_time:.3f} s"
            words += f": verified{seconds}" if proof.verified else ": not verified"
        table.add_row(*(f"{row[name]:.4g}" if name in row else "–" for name in names), words)
    results().print(table, markup=False)
    results().print(found.words, soft_wrap=True, markup=False)
