"""Tables with a row a planner: how far its runs got, percentiles, parts of the problems."""

import math
from collections.abc import Sequence

from optiplan.bench.report.analysis import PERCENTILES, Analysis, Spread, SubsetSummary
from optiplan.bench.report.tables.cells import (
    BOUND,
    NO_INTERVAL,
    NOTHING,
    Cell,
    Head,
    ReportTable,
    number,
    percent,
    planner,
    share,
    success,
    with_interval,
)


def ladder(analysis: Analysis) -> ReportTable:
    """Return the main table: stages reached by runs, and costs of the verified ones."""
    heads = [Head("planner", words=True), Head("success", "share of all runs that are verified"), Head("runs")]
    heads += [
        Head("path found", "geometric success: share of all runs that found a path, whatever came of its times"),
        Head("timed", "share of all runs whose path got its times"),
        Head("lost in timing", "share of the paths found that did not end as a verified motion"),
        Head("executed", "computed torque followed it in simulation: no contact, tool error at most 1 mm RMS"),
        Head("planning time, s", "median of verified runs, by the clock, with times along the path"),
        Head("processor, s", "median of verified runs: processor time of planning, without proof and metrics"),
        Head("duration / bound", f"median of verified runs; {BOUND}"),
        Head("quickest", "share of tasks on which nobody planned more quickly (1 %)"),
        Head("shortest", "share of tasks on which nobody's motion was shorter (1 %)"),
    ]
    rows = []
    for k, one in enumerate(analysis.planners):
        tried = Cell("not tried", kind="none") if one.executed is None else Cell(str(one.executed), one.executed)
        runs = Cell(str(one.runs), one.runs, tip=f"{one.planned} planned, {one.timed} timed, {one.verified} verified")
        stages = [share(value) for value in (one.path_found, one.has_times)]
        lost = math.nan if one.planned == 0 else 1.0 - one.verified / one.planned
        stages.append(Cell(percent(lost), lost, tip=f"{one.planned - one.verified} of {one.planned}"))
        medians = [with_interval(spread.median) for spread in (one.plan_time, one.plan_cpu, one.ratio)]
        shares = [Cell(percent(value), value) for value in (one.quickest, one.shortest)]
        rows.append([planner(k, one.label), success(one.success), runs, *stages, tried, *medians, *shares])
    return ReportTable("planners", "How far runs get, and what the verified ones cost", heads, rows)


def percentiles(analysis: Analysis, field: str) -> ReportTable:
    """Percentiles of one quantity of verified runs: `plan_time` (s) or `ratio`."""
    heads = [Head("planner", words=True), Head("verified runs", "with such a number"), Head("median, 95 % confidence")]
    heads += [Head(f"{p} %", f"{p} % of the verified runs have at most this") for p in PERCENTILES]
    rows = []
    for k, one in enumerate(analysis.planners):
        spread: Spread = getattr(one, field)
        row = [planner(k, one.label), Cell(str(spread.runs), spread.runs), with_interval(spread.median)]
        for p, value in zip(PERCENTILES, spread.percentiles, strict=True):
            few = spread.runs * (100 - p) < 100
            tip = f"of fewer than {100 // (100 - p)} runs: little more than the largest" if few and spread.runs else ""
            row.append(Cell(number(value), value, "few" if tip else "", tip))
        rows.append(row)
    what = {"plan_time": "Planning time of verified runs, s", "ratio": "Duration / bound of verified runs"}[field]
    return ReportTable(f"percentiles-{field}", what, heads, rows)


def parts(analysis: Analysis, found: Sequence[SubsetSummary], what: str) -> ReportTable:
    """Success, median planning time and ratio of every planner on parts of the problems, side by side."""
    heads = [Head("planner", words=True)]
    heads += [Head(f"{part.name} ({part.problems})", f"{part.name}: {part.problems} problems") for part in found]
    rows = []
    for k, label in enumerate(analysis.runs.planners):
        rows.append([planner(k, label), *(_part(part, k) for part in found)])
    return ReportTable(f"by-{what}", f"Success, median planning time and duration / bound by {what}", heads, rows)


def _part(part: SubsetSummary, k: int) -> Cell:
    share, seconds, ratio = part.success[k], part.plan_time[k], part.ratio[k]
    if math.isnan(share.value):
        return Cell(NOTHING, kind="none")
    more = "" if math.isnan(seconds) else f"<br><small>{number(seconds)} s · {number(ratio)}</small>"
    ends = f"verified {percent(share.low)} to {percent(share.high)} with 95 % confidence"
    shaded = f'<span class=heat style="--share:{share.value:.2f}">{percent(share.value)}{more}</span>'
    return Cell(shaded, share.value, "heated", NO_INTERVAL if share.ends is None else ends, share.ends)
