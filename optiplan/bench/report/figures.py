"""The figures of a report: drawn once by matplotlib, for the page (in its colours, light or dark) and as files.

Planners beyond the seventh are told apart by the line's style: solid, dashed, dotted, dash-dotted.
"""

import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from optiplan.arrays import Array
from optiplan.bench.report.analysis import Analysis
from optiplan.bench.results.measures import RunMeasure
from optiplan.bench.statistics.intervals_and_tests import share_within
from optiplan.figure_style import COLOURS, INK, LINE, element_of, line_of, line_style, sheet, styled, undated

FARTHEST = 100.0
"""End of a performance profile at most."""

STEPS = 200
"""Points of a curve at most: more cannot be seen."""

_DECIMALS = re.compile(r"(\.\d)\d+")
"""Of coordinates in a picture, pt: more than one cannot be seen."""

_EDGE = 4.0
"""Left free around a figure, px of 1/100 inch."""


class Figure(NamedTuple):
    """A figure: file name, heading, what it shows and how to read it, and what draws it on axes."""

    name: str
    title: str
    caption: str
    draw: Callable[[Analysis, Any], None]


def figures(analysis: Analysis) -> list[Figure]:
    """Return the figures that are not empty."""
    found = [FIGURES[0]]
    if analysis.runs.verified.any():
        shown = {figure.name for figure in FIGURES}
        if analysis.common <= 1:
            shown -= {"profile-time", "profile-duration"}
        if not np.isfinite(analysis.runs.plan_time[analysis.runs.verified]).any():  # imported runs may tell none
            shown -= {"success-over-time", "planning-time", "profile-time"}
        if not any(np.isfinite(ratio).any() for _, ratio in analysis.quality.curves):
            shown -= {"quality-over-time"}
        found += [figure for figure in FIGURES[1:] if figure.name in shown]
    return found


def measure_figures(analysis: Analysis) -> list[Figure]:
    """Return a figure of each stored measure that has none of its own, over verified runs."""
    if not analysis.runs.verified.any():
        return []
    others = [one for one in analysis.measures if one.name not in ("plan_time", "ratio")]
    return [Figure(f"measure-{one.name}", one.label, _BOX, partial(_measure, one)) for one in others]


def inline_svg(figure: Figure, analysis: Analysis, prefix: str = "") -> str:
    """The figure as an SVG element for the page: transparent, in the page's colours, ids that begin with a prefix."""
    with _drawn(figure, analysis) as drawn:
        text = element_of(drawn, transparent=True)
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    text = re.sub(r' d="[^"]*"', lambda path: _DECIMALS.sub(r"\1", path[0]).replace("\n", ""), text)
    text = text.replace(INK, "currentColor").replace(LINE, "var(--line)")
    for k, colour in enumerate(COLOURS):
        text = text.replace(colour, f"var(--c{k})")
    text = re.sub(r"font: ([\d.]+px) [^;\"]*", r"font-size: \1; font-family: inherit", text)
    text = re.sub(r'(\bid="|url\(#|xlink:href="#)', rf"\g<1>{prefix}{figure.name}-", text)
    return text.replace("<svg ", f'<svg role="img" aria-label="{figure.title}" ', 1)


def write_figures(analysis: Analysis, folder: Path) -> list[Path]:
    """Write every figure as `<name>.png` (200 dpi), `<name>.svg` and `<name>.pdf`, on white."""
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for figure in [*figures(analysis), *measure_figures(analysis)]:
        with _drawn(figure, analysis) as drawn:
            for kind in ("png", "svg", "pdf"):
                path = folder / f"{figure.name}.{kind}"
                drawn.savefig(path, dpi=200, facecolor="white", metadata=undated(kind))
                written.append(path)
    return written


@contextmanager
def _drawn(figure: Figure, analysis: Analysis) -> Iterator[Any]:
    with styled(font__size=9, svg__hashsalt=figure.name):
        drawn = sheet(max(3.3, 0.225 * len(analysis.planners) + 1.0), layout=None)
        ax = drawn.add_subplot()
        figure.draw(analysis, ax)
        _fill(drawn, ax)
        yield drawn


def _fill(sheet: Any, ax: Any) -> None:
    """Let the axes with their labels and legend fill the sheet; a fifth of the time of matplotlib's own layouts."""
    own, whole = ax.get_window_extent(), ax.get_tightbbox()
    width, height = sheet.bbox.width, sheet.bbox.height
    sheet.subplots_adjust(
        left=(own.x0 - whole.x0 + _EDGE) / width,
        right=1.0 - (whole.x1 - own.x1 + _EDGE) / width,
        bottom=(own.y0 - whole.y0 + _EDGE) / height,
        top=1.0 - (whole.y1 - own.y1 + _EDGE) / height,
    )


def _ladder(analysis: Analysis, ax: Any) -> None:
    rows = np.arange(len(analysis.planners))
    stages = (("planned", "#b9d9ec"), ("timed", "#6db3da"), ("verified", "#1a76b4"))
    for (stage, colour), height in zip(stages, (0.78, 0.58, 0.38), strict=True):
        widths = [100.0 * getattr(one, stage) / max(one.runs, 1) for one in analysis.planners]
        ax.barh(rows, widths, height, color=colour, label=stage)
    value, low, high = 100.0 * np.array([one.success for one in analysis.planners]).T
    value = np.nan_to_num(value)
    ax.errorbar(value, rows, xerr=[value - low, high - value], fmt="none", color=INK, lw=1.0, capsize=2.5)
    tried = [
        (100.0 * one.executed / one.runs, k) for k, one in enumerate(analysis.planners) if one.executed is not None
    ]
    if tried:
        ax.plot(*zip(*tried, strict=True), "d", color=COLOURS[1], ms=5, label="executed")
    _name_rows(analysis, ax)
    ax.set(xlim=(0, 102), xlabel="share of all runs, % (line: 95 % confidence of “verified”)")
    ax.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=4, borderaxespad=0.2)


def _over_time(analysis: Analysis, ax: Any) -> None:
    runs = analysis.runs
    end = float(np.nanmax(runs.plan_time[runs.verified]))
    for k, one in enumerate(analysis.planners):
        times = runs.plan_time[(runs.planner == k) & runs.verified]
        _step(ax, k, one.label, share_within(times, one.runs), end)
    _plain_log(ax)
    ax.set(ylim=(0, 102), xlabel="planning time, s", ylabel="verified by then, % of all runs")
    _legend(ax)


def _profile(analysis: Analysis, ax: Any, ratios: Array, what: str) -> None:
    end = float(np.clip(ratios[np.isfinite(ratios)].max(initial=1.0), 1.1, FARTHEST))
    for k, one in enumerate(analysis.planners):
        _step(ax, k, one.label, share_within(ratios[:, k], len(ratios)), end)
    _plain_log(ax)
    ax.set(xlim=(1.0, end), ylim=(0, 102), xlabel=what, ylabel="within this factor, % of tasks")
    _legend(ax)


def _profile_time(analysis: Analysis, ax: Any) -> None:
    _profile(analysis, ax, analysis.time_ratios, "planning time / that of the quickest")


def _profile_duration(analysis: Analysis, ax: Any) -> None:
    _profile(analysis, ax, analysis.duration_ratios, "duration of the motion / that of the shortest")


def _quality(analysis: Analysis, ax: Any) -> None:
    """Median over all runs of duration / best known, of the best verified answer so far."""
    curves = analysis.quality.curves
    ends = [float(times[-1]) for times, _ in curves if len(times)]
    for k, (times, ratio) in enumerate(curves):
        known = np.isfinite(ratio)
        if not known.any():
            continue
        x, y = np.append(times[known], max(ends)), np.append(ratio[known], ratio[known][-1])
        (line,) = ax.step(x, y, where="post", label=analysis.planners[k].label, lw=1.7, **line_style(k))
        line.set_gid(f"planner{k}")
        (dot,) = ax.plot(x[:1], y[:1], "o", color=line_of(k)[0], ms=3.5)
        dot.set_gid(f"first-planner{k}")
    _plain_log(ax)
    ax.axhline(1.0, color=INK, lw=0.8)
    ax.set(xlabel="planning and proving, s", ylabel="duration / best known, median of all runs")
    _legend(ax)


def _measure(measure: RunMeasure, analysis: Analysis, ax: Any) -> None:
    _boxes(analysis, ax, measure.values)
    values = measure.values[analysis.runs.verified]
    values = values[np.isfinite(values)]
    if len(values) and values.min() > 0.0 and values.max() > 30.0 * values.min():
        _plain_log(ax)
    ax.set_xlabel(measure.title)


def _boxes(analysis: Analysis, ax: Any, values: Array) -> None:
    """A row a planner: median, middle half, 5th to 95th percentile of values (n,) over its verified runs."""
    runs = analysis.runs
    for k in range(len(analysis.planners)):
        mine = values[(runs.planner == k) & runs.verified]
        mine = mine[np.isfinite(mine)]
        if len(mine) == 0:
            continue
        p5, p25, p50, p75, p95 = np.percentile(mine, [5, 25, 50, 75, 95])
        ax.plot([p5, p95], [k, k], color=COLOURS[0], lw=1.2, gid=f"line-planner{k}")
        ax.plot([p25, p75], [k, k], color=COLOURS[0], lw=7.0, alpha=0.55, solid_capstyle="butt", gid=f"half-planner{k}")
        ax.plot(p50, k, "o", color=COLOURS[1], ms=4.5, gid=f"dot-planner{k}")
    _name_rows(analysis, ax)


def _ratios(analysis: Analysis, ax: Any) -> None:
    _boxes(analysis, ax, analysis.runs.ratio)
    _plain_log(ax)
    ax.axvline(1.0, color=INK, lw=0.8)
    ax.set_xlabel("duration / bound of the problem")


def _times(analysis: Analysis, ax: Any) -> None:
    _boxes(analysis, ax, analysis.runs.plan_time)
    _plain_log(ax)
    ax.set_xlabel("planning time, s")


def _step(ax: Any, k: int, label: str, curve: tuple[Array, Array], end: float) -> None:
    """A curve of shares (m,) reached at x (m,), from 0 and on to the end, thinned to what can be seen."""
    x, share = curve
    if len(x) > STEPS:
        keep = np.unique(np.linspace(0, len(x) - 1, STEPS).astype(int))
        x, share = x[keep], share[keep]
    if len(x):
        x = np.concatenate([x[:1], x, [max(end, x[-1])]])
        share = np.concatenate([[0.0], share, share[-1:]])
    (line,) = ax.step(x, 100.0 * share, where="post", label=label, lw=1.7, **line_style(k))
    line.set_gid(f"planner{k}")


def _legend(ax: Any) -> None:
    ax.legend(loc="upper left", bbox_to_anchor=(1.01, 1.02), handlelength=2.6, labelspacing=0.35, fontsize=8.5)


def _name_rows(analysis: Analysis, ax: Any) -> None:
    rows = range(len(analysis.planners))
    ax.set_yticks(rows, [one.label for one in analysis.planners])
    ax.set_ylim(len(rows) - 0.4, -0.6)
    ax.tick_params(axis="y", length=0)
    ax.grid(visible=False, axis="y")


def _plain_log(ax: Any) -> None:
    """A logarithmic axis with numbers as people write them, also within one decade."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    ax.set_xscale("log")
    low, high = ax.get_xlim()
    steps: Sequence[float] = (1.0,) if high / low > 1000.0 else (1.0, 2.0, 5.0)
    if high / low < 6.0:
        steps = (1.0, 1.2, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 7.0)
    if high / low < 2.2:
        steps = (*(0.1 * k for k in range(10, 20)), 2.0, 2.2, 2.5, 3.0, 3.5, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0)
    ax.xaxis.set_major_locator(LogLocator(subs=steps))
    ax.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
    ax.xaxis.set_minor_formatter(NullFormatter())


_BOX = "Dot: median; bar: the middle half; line: from the 5th to the 95th percentile; verified runs only."
_RULE = "Left end: how often a planner is the best; right end: how often it succeeds. Tasks that nobody solved count."

FIGURES = (
    Figure("ladder", "How far runs get", "Each bar stands for all runs of a planner, failures included.", _ladder),
    Figure(
        "success-over-time",
        "Success within a time",
        "Share of all runs that were planned within the time and then verified. A failure never counts as a time.",
        _over_time,
    ),
    Figure(
        "quality-over-time",
        "Quality against time",
        "Dot: from here on half of all runs have a verified answer; line: how good the best so far is, against the "
        "best known of the problem. A run without an answer counts as one of infinite duration.",
        _quality,
    ),
    Figure("planning-time", "Planning time", _BOX, _times),
    Figure(
        "duration-ratio", "Duration / bound", f"No verified motion is below 1: one bound a problem. {_BOX}", _ratios
    ),
    Figure("profile-time", "Performance profile of planning time", _RULE, _profile_time),
    Figure("profile-duration", "Performance profile of duration", _RULE, _profile_duration),
)
