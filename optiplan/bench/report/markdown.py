"""The results as a Markdown table, for READMEs."""

from optiplan.bench.report.analysis import Analysis, PlannerNumbers
from optiplan.bench.report.tables.cells import NOTHING, number, percent
from optiplan.bench.statistics.intervals_and_tests import Interval

HEADS = (
    *("planner", "runs", "planned", "timed", "verified", "95 % confidence"),
    *("planning time, s", "95 % of them", "processor, s", "duration / bound", "quickest", "shortest"),
)
NOTE = """
Verified: proved free of collisions and within all limits, of all runs; its 95 % interval is of resampled problems.
Planning time (clock), processor time of planning and duration / bound: median of verified runs with its 95 % bootstrap
interval. The bound is one for each problem, the least over the end configurations that were reached or that it lists.
Quickest, shortest: share of tasks on which no planner was better.
"""


def markdown(analysis: Analysis) -> str:
    """ReportTable and note; ends with a newline."""
    rows = [_row(one) for one in analysis.planners]
    lines = [list(HEADS), *rows]
    widths = [max(len(line[k]) for line in lines) for k in range(len(HEADS))]
    rule = ["-" * widths[0], *(f"{'-' * (width - 1)}:" for width in widths[1:])]
    text = "\n".join(f"| {' | '.join(_fit(line, widths))} |" for line in [lines[0], rule, *rows])
    return f"{text}\n{NOTE}"


def _row(one: PlannerNumbers) -> list[str]:
    shares = [percent(count / one.runs) if one.runs else NOTHING for count in (one.planned, one.timed, one.verified)]
    confidence = NOTHING if one.success.ends is None else " to ".join(map(percent, one.success.ends))
    costs = [_within(one.plan_time.median), number(one.plan_time.percentiles[2])]
    costs += [_within(one.plan_cpu.median), _within(one.ratio.median)]
    label = one.label.replace("|", "\\|")
    return [label, str(one.runs), *shares, confidence, *costs, percent(one.quickest), percent(one.shortest)]


def _within(value: Interval) -> str:
    return number(value.value) + ("" if value.ends is None else f" [{number(value.low)}, {number(value.high)}]")


def _fit(line: list[str], widths: list[int]) -> list[str]:
    return [line[0].ljust(widths[0]), *(text.rjust(width) for text, width in zip(line[1:], widths[1:], strict=True))]
