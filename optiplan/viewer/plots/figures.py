"""The figures by name, drawn and written: PNG, SVG and PDF of each, CSV of what they show."""

import csv
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.errors import InputError, Issue, UnknownChoiceError
from optiplan.figure_style import INK, line_style, sheet, styled, undated
from optiplan.files import replacing
from optiplan.records import dataclass
from optiplan.viewer.plots.joint_figure import QUANTITIES, bounds, draw_joints, extrema_of
from optiplan.viewer.plots.lessons.laws import draw_laws
from optiplan.viewer.plots.lessons.pseudo_vias import draw_pseudo_vias
from optiplan.viewer.plots.lessons.singularities import draw_singularities
from optiplan.viewer.plots.lessons.targets import draw_targets
from optiplan.viewer.plots.path_figure import draw_path
from optiplan.viewer.plots.runs import PlottedRun

PICTURES = ("png", "svg", "pdf")
FORMATS = (*PICTURES, "csv")
DPI = 200

CSV_TOOL = ("x", "y", "z", "qx", "qy", "qz", "qw", "speed", "turning")
"""Columns of the tool: position in the world, m, quaternion, speed, m/s, and angular speed, rad/s."""

CSV_LIMITS = ("run", "joint", "quantity", "unit", "lower", "upper", "least", "least_at", "largest", "largest_at")

_TOOL_ROWS = ("x, m", "y, m", "z, m", "speed, m/s", "turning, rad/s")


PlotStyle = Literal["paper", "textbook"]
STYLES: dict[PlotStyle, dict[str, Any]] = {
    "paper": {},
    "textbook": {"font__size": 10, "axes__titlesize": 10, "lines__linewidth": 1.8, "axes__edgecolor": INK},
}
"""What a style changes of the style of every figure."""


@dataclass(frozen=True)
class PlotOptions:
    """How the figures are drawn.

    Attributes:
        joints: names of the joints to show; None: all.
        share: joints in percent of their limits instead of units.
        frames: tool frames along the path; 0 for none.
        style: `textbook` has axes that the curves fill, and the figures of `LESSONS`.
    """

    joints: tuple[str, ...] | None = None
    share: bool = False
    frames: int = 9
    style: PlotStyle = "paper"


Draw = Callable[[Sequence[PlottedRun], PlotOptions], Any]

FIGURES: dict[str, Draw] = {
    "joints": lambda runs, options: draw_joints(
        runs, _joints(runs, options), options.share, by_curve=options.style == "textbook"
    ),
    "tool": lambda runs, options: _draw_tool(runs),
    "path": lambda runs, options: draw_path(runs, options.frames),
}
"""Figures of runs by name: joints against time, tool against time, path of the tool in space and in planes."""

LESSONS: dict[str, Draw] = {
    "laws": lambda runs, options: draw_laws(runs),
    "accuracy": lambda runs, options: draw_targets(),
    "singularities": lambda runs, options: draw_singularities(runs),
    "vias": lambda runs, options: draw_pseudo_vias(runs),
}
"""Figures of the textbook style, of one run or of none: time laws, accuracy and repeatability, singularities, vias."""


def figures_of(style: PlotStyle) -> dict[str, Draw]:
    """The figures that a style has, by name."""
    return FIGURES | LESSONS if style == "textbook" else FIGURES


def usual(style: PlotStyle, runs: int) -> tuple[str, ...]:
    """Names of the figures drawn where none is asked for: without a run those that need none."""
    return tuple(LESSONS) if style == "textbook" and not runs else tuple(FIGURES)


def draw(name: str, runs: Sequence[PlottedRun], options: PlotOptions) -> Any:
    """Draw a figure of runs of one robot, as matplotlib's `Figure`.

    Raises:
        UnknownChoiceError: no such figure in this style, or no such joint.
        InputError: no run where the figure needs one, several where it takes one, or one that it cannot show.
    """
    known = figures_of(options.style)
    if name not in known:
        raise UnknownChoiceError("figure", name, known)
    if name in LESSONS and len(runs) > 1:
        raise InputError([Issue("plot", None, "runs", f"{len(runs)} runs for '{name}'", "one run, or none")])
    if name in FIGURES and not runs:
        raise InputError([Issue("plot", None, "runs", f"none for '{name}'", "at least one run that has a trajectory")])
    with styled(**STYLES[options.style]):
        return known[name](runs, options)


def save_figures(names: Sequence[str], runs: Sequence[PlottedRun], options: PlotOptions, path: Path) -> None:
    """Write figures into one file of the kind that its suffix names; it appears whole or not at all.

    A PDF has a page for each, CSV is the same whatever the figure; the others hold one.

    Raises:
        InputError: another suffix, several figures in a file that holds one, or CSV without a run.
        UnknownChoiceError: as `draw`.
    """
    kind = figure_format(path)
    if kind not in ("pdf", "csv") and len(names) != 1:
        found = f"{len(names)} figures: {', '.join(names)}"
        raise InputError([Issue(str(path), None, "figure", found, f"one of them for a {kind}, a .pdf or a folder")])
    for name in (options.joints or ()) if runs else ():
        _joint(runs, name)
    if kind == "csv" and not runs:
        raise InputError([Issue(str(path), None, "runs", "none", "a run, whose curves a CSV holds")])
    if kind == "csv":
        with replacing(path) as temporary:
            _write_curves(runs, temporary)
        return
    figures = [draw(name, runs, options) for name in names]
    with replacing(path) as temporary:
        _save(figures, temporary, kind)


def write_all(
    names: Sequence[str], kinds: Sequence[str], runs: Sequence[PlottedRun], options: PlotOptions, folder: Path
) -> list[Path]:
    """Write every figure as `<name>.<kind>` into a folder; as CSV `curves.csv` and `limits.csv`.

    Raises:
        UnknownChoiceError: as `draw`.
    """
    written = []
    for kind in kinds:
        if kind == "csv":
            written += [folder / "curves.csv", folder / "limits.csv"]
            save_figures(names, runs, options, written[-2])
            with replacing(written[-1]) as temporary:
                _write_limits(runs, temporary)
            continue
        for name in names:
            written.append(folder / f"{name}.{kind}")
            save_figures([name], runs, options, written[-1])
    return written


def figure_format(path: Path) -> str:
    """The format that a file's suffix names.

    Raises:
        InputError: none of ours.
    """
    kind = path.suffix.lower().removeprefix(".")
    if kind not in FORMATS:
        expected = f"a file that ends in {', '.join(f'.{one}' for one in FORMATS)}, or a folder"
        raise InputError([Issue(str(path), None, "out", repr(path.suffix) if kind else "no ending", expected)])
    return kind


def _draw_tool(runs: Sequence[PlottedRun]) -> Any:
    """Draw origin of the tool frame in the world, its speed and its angular speed, a colour a run."""
    figure = sheet(1.3 * len(_TOOL_ROWS) + 0.6)
    panels = figure.subplots(len(_TOOL_ROWS), 1, sharex=True)
    for k, run in enumerate(runs):
        curves = run.curves
        values = (*curves.X_WT[:, :3, 3].T, curves.speed, curves.turning)
        for panel, value in zip(panels, values, strict=True):
            panel.plot(curves.t, value, label=run.legend, **line_style(k))
    for panel, title in zip(panels, _TOOL_ROWS, strict=True):
        panel.set_ylabel(title)
    panels[-1].set_xlabel("time, s")
    figure.align_ylabels(list(panels))
    robot = runs[0].problem.robot
    names = ", ".join(dict.fromkeys(run.problem.name for run in runs))
    figure.suptitle(f"{names}: frame {robot.tool_frame} of {robot.name} in the world", fontsize=9)
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=min(3, len(runs)))
    return figure


def _save(figures: Sequence[Any], path: Path, kind: str) -> None:
    dated = undated(kind)
    with styled():
        if kind == "pdf":
            from matplotlib.backends.backend_pdf import PdfPages

            with PdfPages(path, metadata=dated) as pages:
                for figure in figures:
                    pages.savefig(figure)
        else:
            figures[0].savefig(path, format=kind, dpi=DPI, metadata=dated)


def _joints(runs: Sequence[PlottedRun], options: PlotOptions) -> list[int]:
    names = runs[0].problem.robot.joint_names
    return [_joint(runs, name) for name in options.joints] if options.joints else list(range(len(names)))


def _joint(runs: Sequence[PlottedRun], name: str) -> int:
    names = runs[0].problem.robot.joint_names
    if name not in names:
        raise UnknownChoiceError("joint", name, names)
    return names.index(name)


def _write_curves(runs: Sequence[PlottedRun], path: Path) -> None:
    """Write `run`, `t`, `<joint>.<quantity>` of every joint, and `tool.…`; numbers to the last digit."""
    names = runs[0].problem.robot.joint_names
    heads = [f"{joint}.{quantity}" for quantity in QUANTITIES for joint in names]
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["run", "t", *heads, *(f"tool.{name}" for name in CSV_TOOL)])
        for run in runs:
            curves = run.curves
            table = np.column_stack([curves.t, *curves.joints, curves.torque, _tool_columns(run)])
            writer.writerows([run.label, *row] for row in table.tolist())


def _write_limits(runs: Sequence[PlottedRun], path: Path) -> None:
    """Write limits (nothing where there is none), exact extrema (of torques: refined samples) and their times."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(CSV_LIMITS)
        for run in runs:
            for quantity in QUANTITIES:
                for joint, name in enumerate(run.problem.robot.joint_names):
                    ends = ["" if np.isinf(value) else value for value in bounds(run, quantity, joint)]
                    in_unit = run.problem.robot.unit(quantity, joint)
                    writer.writerow([run.label, name, quantity, in_unit, *ends, *_extremes(run, quantity, joint)])


def _extremes(run: PlottedRun, quantity: str, joint: int) -> list[float]:
    """Least value and when, largest value and when."""
    e = extrema_of(run, quantity)
    return [float(x[joint]) for x in (e.low, e.t_low, e.high, e.t_high)]


def _tool_columns(run: PlottedRun) -> Array:
    """Columns of `CSV_TOOL`, (k, 9); neighbouring quaternions have no jump of sign."""
    curves = run.curves
    quaternions = np.array([pin.Quaternion(X[:3, :3]).coeffs() for X in curves.X_WT])
    turned = np.einsum("ij,ij->i", quaternions[1:], quaternions[:-1]) < 0.0
    signs = np.cumprod(np.concatenate([[1.0], np.where(turned, -1.0, 1.0)]))
    return np.column_stack([curves.X_WT[:, :3, 3], quaternions * signs[:, None], curves.speed, curves.turning])
