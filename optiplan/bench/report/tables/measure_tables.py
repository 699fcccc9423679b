"""Tables of every stored measure: by planner, by planner on one problem; and of quality against time."""

import html
import math
from collections.abc import Sequence

import numpy as np

from optiplan.arrays import Flags
from optiplan.bench.report.analysis import Analysis, Spread
from optiplan.bench.report.quality import TIMES
from optiplan.bench.report.tables.cells import FEW, NOTHING, Cell, Head, ReportTable, percent, planner
from optiplan.bench.results.measures import RunMeasure
from optiplan.bench.statistics.intervals_and_tests import Interval, median_of_known

BOX = (90.0, 12.0)
"""Width and height of a small box plot, px."""


def measure_table(analysis: Analysis) -> ReportTable:
    """Median of every measure over verified runs, with its interval and a small box plot on one axis a column."""
    heads = [Head("planner", words=True), Head("verified runs")]
    heads += [Head(one.title, f"{one.label}: median of verified runs, 95 % confidence") for one in analysis.measures]
    ranges = [_range(spreads) for spreads in analysis.spreads]
    rows = []
    for k, one in enumerate(analysis.planners):
        cells = [_spread(spreads[k], ends) for spreads, ends in zip(analysis.spreads, ranges, strict=True)]
        rows.append([planner(k, one.label), Cell(str(one.verified), one.verified), *cells])
    return ReportTable("measures", "Every stored measure: median of verified runs", heads, rows)


def quality_table(analysis: Analysis) -> ReportTable:
    """Duration / best known of the best verified answer at 0.1, 1, 10 s and in the end, and who has one by then."""
    heads = [Head("planner", words=True)]
    tip = "median over all runs of duration / best known; without an answer yet: infinite. Below: runs with an answer"
    heads += [
        Head(f"by {time:g} s", f"the best verified answer by {time:g} s of planning and proving: {tip}")
        for time in TIMES
    ]
    heads.append(Head("in the end", tip))
    rows = []
    for k, one in enumerate(analysis.quality.planners):
        cells = [_quality(ratio, share) for ratio, share in zip(one.ratio, one.answered, strict=True)]
        rows.append([planner(k, one.label), *cells])
    return ReportTable("quality", "Duration / best known of the best verified answer by a time", heads, rows)


def problem_table(analysis: Analysis, number: int) -> ReportTable:
    """One problem (by its index): of every planner how many runs are verified, and the median of every measure."""
    runs, name = analysis.runs, analysis.runs.problems[number]
    mine = runs.problem == number
    heads = [Head("planner", words=True), Head("verified", "of the runs on this problem")]
    shown = [one for one in analysis.measures if np.isfinite(one.values[mine & runs.verified]).any()]
    heads += [Head(one.title, f"{one.label}: median of the verified runs on this problem") for one in shown]
    rows = []
    for k, label in enumerate(runs.planners):
        tried = mine & (runs.planner == k)
        good = tried & runs.verified
        share = float(good.sum() / tried.sum()) if tried.any() else math.nan
        cells = [_single(one, good) for one in shown]
        rows.append([planner(k, label), Cell(f"{good.sum()} of {tried.sum()}", share), *cells])
    return ReportTable(f"problem-{name.replace('/', '-')}", f"Problem {name}", heads, rows)


def digits(value: float) -> str:
    """Four digits, and no more than three decimals."""
    if math.isnan(value):
        return NOTHING
    if math.isinf(value):
        return "∞"
    size = abs(value)
    places = 3 if size < 10.0 else 2 if size < 100.0 else 1 if size < 1000.0 else 0
    return f"{value:.{places}f}" if size >= 0.001 or size == 0.0 else f"{value:.2g}"


def _spread(spread: Spread, shown: tuple[float, float]) -> Cell:
    middle = spread.median
    if math.isnan(middle.value):
        return Cell(NOTHING, kind="none")
    ends = middle.ends
    more = FEW if ends is None else f" <small class=interval>[{digits(ends[0])}, {digits(ends[1])}]</small>"
    low, quarter, high = spread.lower[0], spread.lower[1], spread.percentiles[2]
    tip = f"median of {spread.runs} runs; half of them in {digits(quarter)} to {digits(spread.percentiles[1])}, "
    tip += f"nine of ten in {digits(low)} to {digits(high)}"
    return Cell(f"{digits(middle.value)}{more}{_box(spread, shown)}", middle.value, "boxed", tip, ends)


def _range(spreads: Sequence[Spread]) -> tuple[float, float]:
    """Least and largest of what the boxes of a column show."""
    values = np.array([[one.lower[0], one.percentiles[2]] for one in spreads]).reshape(-1)
    values = values[np.isfinite(values)]
    return (float(values.min()), float(values.max())) if len(values) else (0.0, 1.0)


def _box(spread: Spread, ends: tuple[float, float]) -> str:
    """Line: from the 5th to the 95th percentile; bar: the middle half; dot: the median."""
    width, height = BOX
    scale = (width - 6.0) / max(ends[1] - ends[0], 1e-300)
    values = (*spread.lower, spread.percentiles[0], spread.percentiles[1], spread.percentiles[2])
    if not np.isfinite(values).all():
        return ""
    low, quarter, middle, most, high = (3.0 + scale * (value - ends[0]) for value in values)
    y = 0.5 * height
    return (
        f'<svg class=box viewBox="0 0 {width:.0f} {height:.0f}" aria-hidden="true">'
        f'<path d="M{low:.1f} {y}H{high:.1f}"/>'
        f'<path class=half d="M{quarter:.1f} {y}H{max(most, quarter + 0.5):.1f}"/>'
        f'<circle cx="{middle:.1f}" cy="{y}" r="2.6"/></svg>'
    )


def _quality(ratio: Interval, share: float) -> Cell:
    words = f"<br><small>{percent(share)} answered</small>"
    if not math.isfinite(ratio.value):
        return Cell(f"{NOTHING}{words}", kind="none", tip="fewer than half of the runs have an answer by then")
    known = math.isfinite(ratio.low) and math.isfinite(ratio.high)
    more = f" <small class=interval>[{digits(ratio.low)}, {digits(ratio.high)}]</small>" if known else ""
    return Cell(f"{digits(ratio.value)}{more}{words}", ratio.value, interval=(ratio.low, ratio.high) if known else None)


def _single(measure: RunMeasure, good: Flags) -> Cell:
    middle = median_of_known(measure.values[good])
    return Cell(NOTHING, kind="none") if math.isnan(middle) else Cell(html.escape(digits(middle)), middle)
