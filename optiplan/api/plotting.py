"""`plot`: figures of runs, from Python."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from optiplan.api.loading import load_run
from optiplan.errors import (
    UnknownChoiceError,
    choice_argument,
    described,
    flag_argument,
    path_argument,
    whole_argument,
    words_of_call,
    writing,
    wrong_argument,
)
from optiplan.runs.run import Run
from optiplan.viewer.plots.figures import (
    FIGURES,
    STYLES,
    PlotOptions,
    PlotStyle,
    draw,
    figure_format,
    figures_of,
    save_figures,
    usual,
)
from optiplan.viewer.plots.runs import PlottedRun, comparable

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def plot(
    *runs: Run | Path | str,
    figure: str | None = None,
    style: PlotStyle = "paper",
    joints: Sequence[str] | None = None,
    share: bool = False,
    frames: int = 9,
    out: Path | str | None = None,
) -> "Figure":
    """Draw a figure of one run, or of several of one robot together; in textbook style also of a lecture's subject.

    Args:
        runs: runs with a trajectory, or folders of them; at least one but for the textbook's own figures.
        figure: `joints`: position, velocity, acceleration, jerk and torque against time, with limits (dashed) and the
            exact extrema (dots); `tool`: position and speed of the tool against time; `path`: its path in space and
            seen along the axes, with tool frames along it; None: `joints`, without a run `laws`. In textbook style, of
            one run or of none: `laws`: cubic, quintic, LSPB, bang-bang and S-curve of the joint that moves farthest;
            `accuracy`: four targets; `singularities`: wrist, elbow and shoulder with the ellipsoid that gets flat;
            `vias`: pseudo-via points step by step.
        style: `paper`; or `textbook`: axes that the curves fill, limits only where they lie within these.
        joints: names of the joints to show; None: all.
        share: joints in percent of their limits: -100 at the lower and 100 at the upper one.
        frames: tool frames along the path, evenly in time.
        out: a file to write as well, PNG, SVG, PDF or, of the curves themselves, CSV.

    Returns:
        A figure of matplotlib's, to be changed and saved as others are.

    Raises:
        InputError: no run, one without a trajectory, runs of other joints, or an argument that does not fit.

    Example:
        >>> import optiplan as op
        >>> run = op.plan(op.load_problem("12_planar"))
        >>> op.plot(run, figure="tool").savefig("tool.pdf")
    """
    path = None if out is None else path_argument("plot", "out", out, "the path of a file")
    if path is not None:
        with words_of_call("op.plot", {", or a folder": ""}):
            figure_format(path)
    choice_argument("plot", "style", style, STYLES)
    known = figures_of(style)
    if figure is not None:
        choice_argument("plot", "figure", figure, known)
    name = figure or usual(style, len(runs))[0]
    drawn = comparable([_plotted(run) for run in runs], "op.plot") if runs or name in FIGURES else ()
    flag_argument("plot", "share", share)
    whole_argument("plot", "frames", frames, 0, most=1000)
    options = PlotOptions(_names(joints), share, frames, style)
    try:
        if path is not None:
            with writing("plot", path, "out"):
                save_figures([name], drawn, options, path)
        drawn_figure: Figure = draw(name, drawn, options)
        return drawn_figure
    except UnknownChoiceError as error:
        raise error.of_argument("plot", "joints") from None


def _plotted(run: Any) -> PlottedRun:
    if not isinstance(run, Run | Path | str):
        raise wrong_argument("plot", "runs", described(run), "a run of op.plan(…), or the folder of one")
    found = run if isinstance(run, Run) else load_run(run)
    label = found.planner if isinstance(run, Run) else Path(run).name
    if found.trajectory is None:
        raise wrong_argument("plot", "runs", f"'{label}', a run without a trajectory", "runs that have one")
    return PlottedRun(label, found.problem, found.trajectory, found.verified)


def _names(joints: Any) -> tuple[str, ...] | None:
    if joints is None:
        return None
    if isinstance(joints, str) or not isinstance(joints, Sequence) or not all(isinstance(j, str) for j in joints):
        raise wrong_argument("plot", "joints", described(joints), "names of joints")
    return tuple(joints) or None
