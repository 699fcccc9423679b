"""`optiplan export`: the motion of a run for other programs, or to be looked at."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from optiplan.cli.output import Exit, print_error, say
from optiplan.errors import InputError, Issue, errors_about
from optiplan.files import folder_of

if TYPE_CHECKING:
    from optiplan.runs.run import Run

PICTURES = ("png", "mp4")
"""What a motion can be drawn as."""

PROGRAM = "casadi"
"""The program of which the motion is an answer."""


def export(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="a run folder")],
    to: Annotated[
        str, typer.Option("--to", metavar="FORMAT", help="csv, json, npz, ros, urscript, casadi, png or mp4")
    ],
    out: Annotated[Path | None, typer.Option(metavar="FILE", help="to write (default: RUN/motion.…)")] = None,
    rate: Annotated[
        float | None, typer.Option(metavar="HZ", help="least sample rate (default: 200, urscript 500)")
    ] = None,
    cyclic: Annotated[
        bool, typer.Option("--cyclic", help="samples exactly 1/HZ apart; slows the motion by less than one cycle")
    ] = False,
    unverified: Annotated[
        bool, typer.Option("--unverified", help="write the motion even if it is not verified")
    ] = False,
) -> int:
    """Write the motion of a run for a controller or another program.

    The motion is verified again first. The deviation from it of a controller that puts straight lines, cubic or quintic
    polynomials between the samples is printed.
    `casadi` writes the program of which the motion is an answer, for CasADi alone.
    A picture (png) shows the page half-way, a film (mp4) the scene; they need chromium and the extra `pictures`,
    a film also ffmpeg.

    [bold]Examples[/]

      optiplan export runs/shelf --to csv --rate 1000

      optiplan export runs/shelf --to ros --out shelf.yaml

      optiplan export runs/cell --to urscript --out cell.script

      optiplan export runs/shelf --to casadi

      optiplan export runs/shelf --to mp4

    Exit code: 0 written · 2 bad input · 3 the run has no motion · 4 not verified, nothing written.
    """
    from optiplan.api.loading import load_run
    from optiplan.runs.export import FORMATS

    known = (*FORMATS, PROGRAM, *PICTURES)
    if to not in known:
        others = "; for html, mcap and rrd: `optiplan view RUN --export FILE`"
        raise InputError([Issue("--to", None, "format", repr(to), f"one of: {', '.join(known)}{others}")])
    if to not in FORMATS and (rate is not None or cyclic):
        given = "--rate" if rate is not None else "--cyclic"
        why = "none: " + ("a program has no rate" if to == PROGRAM else "pictures have no samples")
        raise InputError([Issue(given, None, "option", f"{given} beside --to {to}", why)])
    stored = load_run(run)
    if stored.trajectory is None:
        reason = stored.failure.detail if stored.failure else "no reason given"
        print_error(f"optiplan: {run} has no motion: {reason}")
        return Exit.NO_PLAN
    if not (stored.verified or unverified):
        print_error(f"optiplan: the motion of {run} is not verified; nothing was written (--unverified writes it)")
        return Exit.NOT_VERIFIED
    folder = folder_of(run)
    if to == PROGRAM:
        return _write_program(stored, out or folder / "motion.casadi.json")
    if to in PICTURES:
        path = out or folder / f"motion.{to}"
        _draw(run, path, to, stored.trajectory.duration)
        say(f"written: {path}")
        return Exit.VERIFIED if stored.verified else Exit.NOT_VERIFIED
    file = out or folder / f"motion{FORMATS[to].suffixes[0]}"
    with errors_about("op.Run.export", "optiplan export"):
        written = stored.export(file, to, rate, cyclic=cyclic, unverified=unverified)
    errors = ", ".join(f"{key} {error:.2g}" for key, error in written.errors.items())
    proved = stored.verified and not (unverified and written.duration != stored.duration)
    verdict = "verified" if proved else "NOT verified"
    told = [
        f"written: {written.path}",
        f"{verdict}; {written.duration:.3f} s, {written.samples} samples",
        f"deviation between samples, rad or m, if interpolated: {errors}",
    ]
    say("\n".join(told))
    return Exit.VERIFIED if proved else Exit.NOT_VERIFIED


def _write_program(stored: "Run", path: Path) -> int:
    """Write the program of planner `casadi` along the motion of a run."""
    from optiplan.api.casadi_problems import casadi_problem

    with errors_about("op.casadi_problem", "optiplan export --to casadi"):
        nlp = casadi_problem(stored.problem, stored)
        size = f"{nlp.x.numel()} variables, {nlp.g.numel()} rows"
        say(f"written: {nlp.save(path)}\n{size}; the file says how to solve it")
    return Exit.VERIFIED if stored.verified else Exit.NOT_VERIFIED


def _draw(run: Path, path: Path, to: str, duration: float) -> None:
    """Write the page of a run half-way as a picture, or its scene as a film."""
    from optiplan.cli.viewing import open_runs
    from optiplan.viewer.page import render_page
    from optiplan.viewer.pictures import find_ffmpeg, save_film, save_picture
    from optiplan.viewer.scene import build_scene

    if path.suffix.lower() != f".{to}" or path.is_dir():
        found = "a folder" if path.is_dir() else f"a name that ends with '{path.suffix}'"
        raise InputError([Issue(str(path), None, "--out", found, f"a file that ends with .{to}")])
    if to == "mp4":
        find_ffmpeg()
    page = render_page(build_scene(*open_runs([run])))
    if to == "png":
        save_picture(page, path, f"t={0.5 * duration:.3f}&paused")
    else:
        save_film(page, path)
