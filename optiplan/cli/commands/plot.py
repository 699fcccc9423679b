"""`optiplan plot`: runs as figures for papers and lectures."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from optiplan.cli.options import AsJson, listed, refuse
from optiplan.cli.output import messages, print_json, say, stdout_is_ours

if TYPE_CHECKING:
    from optiplan.viewer.plots.figures import PlotStyle

NAMES = "joints, tool, path; textbook: laws, accuracy, singularities, vias; several with commas"
KINDS = "png, svg, pdf, csv; several with commas (default: what FILE ends in, else png)"


def plot(
    runs: Annotated[
        list[Path] | None, typer.Argument(metavar="[RUN…]", help="run folders of one robot; textbook: one or none")
    ] = None,
    out: Annotated[Path, typer.Option(metavar="FILE|DIR", help="curves.png, .svg, .pdf, .csv; or a folder")] = Path(
        "figures"
    ),
    figure: Annotated[str | None, typer.Option(metavar="NAME", help=f"{NAMES} (default: those of runs)")] = None,
    style: Annotated[str, typer.Option(metavar="NAME", help="paper, or textbook")] = "paper",
    kinds: Annotated[str | None, typer.Option("--format", metavar="F", help=KINDS)] = None,
    joints: Annotated[str | None, typer.Option(metavar="J,J,…", help="only these joints")] = None,
    share: Annotated[bool, typer.Option("--share", help="joint curves in percent of their limits")] = False,
    frames: Annotated[
        int | None, typer.Option(min=0, max=1000, metavar="N", help="tool frames along the path (default: 9)")
    ] = None,
    as_json: AsJson = False,
) -> int:
    """Draw joints, tool and path of one run, or of several together.

    joints: position, velocity, acceleration, jerk and torque against time, with limits and exact extrema.
    tool: position and speed against time. path: in space and in planes, with tool frames.
    CSV has what the figures show; a PDF has one page per figure. A PNG or SVG file holds one, by default joints.

    [bold]Examples[/]

      optiplan plot runs/shelf                                    figures/joints.png, tool.png, path.png

      optiplan plot runs/trajopt runs/rrtconnect --out compared.pdf

      optiplan plot runs/shelf --figure path --frames 20 --out path.svg

      optiplan plot --style textbook --out lessons.pdf            laws, accuracy, singularities, vias

    Exit code: 0 done · 2 bad input.
    """
    from optiplan.cli.viewing import plotted_runs
    from optiplan.viewer.plots.figures import FIGURES, FORMATS, PlotOptions, figure_format, save_figures, write_all
    from optiplan.viewer.plots.runs import comparable

    asked = None if kinds is None else _chosen("format", kinds, FORMATS)
    to_folder = out.suffix == "" or out.is_dir()
    single = not to_folder and figure_format(out) in ("png", "svg")
    places, look = runs or [], _style(style)
    names = _figures(figure, look, len(places), single)
    if "joints" not in names:
        refuse({"--share": share or None, "--joints": joints}, "goes with the figure joints")
    if "path" not in names:
        refuse({"--frames": frames}, "goes with the figure path")
    if not to_folder and asked not in (None, [figure_format(out)]):
        raise typer.BadParameter(f"--format {kinds}: --out {out} says another; expected a folder for several")
    with stdout_is_ours():
        found, left_out = plotted_runs(places)
        for words in left_out:
            messages().print(f"note: {words}", style="yellow", markup=False, soft_wrap=True)
        drawn = comparable(found) if places or FIGURES.keys() & names else ()
        chosen = None if joints is None else listed(joints)
        options = PlotOptions(chosen, share, PlotOptions.frames if frames is None else frames, look)
        if to_folder:
            written = write_all(names, asked or ["png"], drawn, options, out)
        else:
            save_figures(names, drawn, options, out)
            written = [out]
    if as_json:
        print_json({"written": [str(path) for path in written], "exit_code": 0})
    else:
        say("\n".join(f"written: {path}" for path in written))
    return 0


def _style(text: str) -> "PlotStyle":
    from optiplan.errors import UnknownChoiceError
    from optiplan.viewer.plots.figures import STYLES

    for style in STYLES:
        if style == text:
            return style
    raise UnknownChoiceError("style", text, STYLES)


def _figures(text: str | None, style: "PlotStyle", runs: int, single: bool) -> list[str]:
    from optiplan.viewer.plots.figures import figures_of, usual

    if text is None:
        return list(usual(style, runs))[: 1 if single else None]
    return _chosen("figure", text, tuple(figures_of(style)))


def _chosen(kind: str, text: str, valid: tuple[str, ...]) -> list[str]:
    """The words between commas, each once.

    Raises:
        OptiPlanError: one that is not valid.
    """
    from optiplan.errors import UnknownChoiceError

    chosen = listed(text)
    for word in chosen:
        if word not in valid:
            raise UnknownChoiceError(kind, word, valid)
    return list(chosen)
