"""`optiplan export`: the motion of a run for other programs."""

from pathlib import Path
from typing import Annotated

import typer

from optiplan.cli.output import Exit, print_error, results
from optiplan.errors import InputError, Issue


def export(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="a run folder")],
    to: Annotated[str, typer.Option("--to", metavar="FORMAT", help="csv, json, npz, ros or urscript")],
    out: Annotated[Path | None, typer.Option(metavar="FILE", help="to write; by default RUN/motion.…")] = None,
    rate: Annotated[
        float | None, typer.Option(metavar="HZ", help="samples a second, at least; by default 200, of urscript 500")
    ] = None,
    cyclic: Annotated[
        bool, typer.Option("--cyclic", help="samples exactly 1/HZ apart, the motion slower by less than one cycle")
    ] = False,
    unverified: Annotated[bool, typer.Option("--unverified", help="write a motion that is not verified too")] = False,
) -> int:
    """Write the motion of a run for a controller or another program.

    The motion is verified again first; one that is not is written with --unverified only. Told is how far a controller
    is from the proved motion that puts straight lines, cubic or quintic polynomials between the samples.

    [bold]Examples[/]

      optiplan export runs/shelf --to csv --rate 1000

      optiplan export runs/shelf --to ros --out shelf.yaml

      optiplan export runs/cell --to urscript --out cell.script

    Exit code: 0 written · 2 bad input · 3 the run has no motion · 4 not verified, nothing written.
    """
    from optiplan.api.loading import load_run
    from optiplan.runs.export import FORMATS

    if to not in FORMATS:
        raise InputError([Issue("--to", None, "format", repr(to), f"one of: {', '.join(FORMATS)}")])
    stored = load_run(run)
    if stored.trajectory is None:
        reason = stored.failure.detail if stored.failure else "no reason given"
        print_error(f"optiplan: {run} has no motion: {reason}")
        return Exit.NO_PLAN
    if not (stored.verified or unverified):
        print_error(f"optiplan: the motion of {run} is not verified; nothing was written (--unverified writes it)")
        return Exit.NOT_VERIFIED
    folder = run if run.is_dir() else run.parent
    written = stored.export(out or folder / f"motion{FORMATS[to].suffixes[0]}", to, rate, cyclic=cyclic)
    errors = ", ".join(f"{key} {error:.2g}" for key, error in written.errors.items())
    verdict = "verified" if stored.verified else "NOT verified"
    told = [
        f"written: {written.path}",
        f"{verdict}; {written.duration:.3f} s, {written.samples} samples",
        f"off the motion between samples, rad or m, by interpolation: {errors}",
    ]
    results().print("\n".join(told), markup=False, soft_wrap=True)
    return Exit.VERIFIED if stored.verified else Exit.NOT_VERIFIED
