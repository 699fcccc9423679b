"""Tables of the page. Every value is escaped here; a cell holds its sort key."""

import html
import math
from collections.abc import Sequence
from typing import NamedTuple

from optiplan.bench.report.analysis import PERCENTILES, Analysis, Spread, SubsetSummary
from optiplan.bench.report.figures import COLOURS, line_of
from optiplan.bench.report.pairs import TIE, Paired, PlannerPair
from optiplan.bench.statistics.intervals_and_tests import Interval, holm

NOTHING = "–"
BOUND = "one bound a problem: the least over the end configurations that were reached or that it lists"
FEW = " <small class=interval>few</small>"


class Cell(NamedTuple):
    """A cell: its HTML, what it is sorted by (None: nothing there), its class, its tip."""

    html: str
    key: float | str | None = None
    kind: str = ""
    tip: str = ""


class Head(NamedTuple):
    """Heading of a column, what it means, and whether it holds text."""

    text: str
    tip: str = ""
    words: bool = False


def table(heads: Sequence[Head], rows: Sequence[Sequence[Cell]]) -> str:
    """A table that can be sorted by any column."""
    top = "".join(
        f'<th scope="col"{" class=words" if head.words else ""}{_tip(head.tip)}>'
        f"<button>{html.escape(head.text)}</button></th>"
        for head in heads
    )
    flags = [head.words for head in heads]
    lines = ("".join(_cell(cell, words) for cell, words in zip(row, flags, strict=True)) for row in rows)
    body = "\n".join(f"<tr>{line}</tr>" for line in lines)
    return f"<div class=scroll><table class=sortable><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table></div>"


def _cell(cell: Cell, words: bool) -> str:
    kind = " ".join(part for part in ("words" if words else "", cell.kind) if part)
    known = cell.key is not None and not (isinstance(cell.key, float) and math.isnan(cell.key))
    key = f' data-key="{html.escape(str(cell.key))}"' if known else ""
    named = f' class="{kind}"' if kind else ""
    return f"<td{named}{key}{_tip(cell.tip)}>{cell.html}</td>"


def _tip(text: str) -> str:
    return f' title="{html.escape(text)}"' if text else ""


def number(value: float | None) -> str:
    """With three decimals, so that points stand below each other: s, or a ratio."""
    return NOTHING if value is None or math.isnan(value) else f"{value:.3f}"


def percent(share: float) -> str:
    """With one decimal; never rounded up to all or down to nothing."""
    if math.isnan(share):
        return NOTHING
    value = 100.0 * share
    return f"{min(max(value, 0.1), 99.9) if 0.0 < value < 100.0 else value:.1f} %"


def probability(p: float) -> str:
    """A probability with two digits, or < 0.001."""
    return "&lt; 0.001" if p < 0.001 else f"{p:.2g}" if p < 0.1 else f"{p:.2f}"


def within(value: Interval, what: str = "median") -> Cell:
    """A value with its interval behind it."""
    if math.isnan(value.value):
        return Cell(NOTHING, kind="none")
    known = not math.isnan(value.low)
    more = f" <small class=interval>[{number(value.low)}, {number(value.high)}]</small>" if known else FEW
    tip = f"{what}, 95 % confidence" if known else f"{what} of fewer than 5 problems: no interval"
    return Cell(f"{number(value.value)}{more}", value.value, tip=tip)


def planner(k: int, label: str) -> Cell:
    """A planner's name with the line that it has in the figures."""
    number, dashes = k % len(COLOURS), line_of(k)[1]
    path = f'<path d="M0 3H22" style="stroke: var(--c{number})" stroke-dasharray="{_scaled(dashes)}"/>'
    chip = f'<svg class=chip viewBox="0 0 22 6" aria-hidden="true">{path}</svg>'
    return Cell(f'<span class=planner data-planner="{k}">{chip}{html.escape(label)}</span>', label)


def _scaled(dashes: str) -> str:
    return " ".join(f"{2.2 * float(length):g}" for length in dashes.split())


def success(value: Interval) -> Cell:
    """A share as a bar with its number and interval."""
    if math.isnan(value.value):
        return Cell(NOTHING, kind="none")
    bar = f'<span class=bar><i style="width:{100.0 * value.value:.1f}%"></i></span>'
    known = not math.isnan(value.low)
    more = f"<small>[{100.0 * value.low:.0f}, {100.0 * value.high:.0f}]</small>" if known else FEW
    tip = "95 % confidence, by problems" if known else "of fewer than 5 problems: no interval"
    return Cell(f"{bar}<b>{percent(value.value)}</b> {more}", value.value, "success", tip)


def ladder(analysis: Analysis) -> str:
    """Return the main table: stages reached by runs, and costs of the verified ones."""
    heads = [Head("planner", words=True), Head("success", "share of all runs that are verified")]
    heads += [Head("runs"), Head("planned", "a path was found"), Head("timed", "it got its times")]
    heads += [
        Head("verified", "the verifier found nothing wrong at any time"),
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
        counts = [Cell(str(value), value) for value in (one.runs, one.planned, one.timed, one.verified)]
        medians = [within(spread.median) for spread in (one.plan_time, one.plan_cpu, one.ratio)]
        shares = [Cell(percent(value), value) for value in (one.quickest, one.shortest)]
        rows.append([planner(k, one.label), success(one.success), *counts, tried, *medians, *shares])
    return table(heads, rows)


def percentiles(analysis: Analysis, field: str) -> str:
    """Percentiles of one quantity of verified runs: `plan_time` (s) or `ratio`."""
    heads = [Head("planner", words=True), Head("verified runs", "with such a number"), Head("median, 95 % confidence")]
    heads += [Head(f"{p} %", f"{p} % of the verified runs have at most this") for p in PERCENTILES]
    rows = []
    for k, one in enumerate(analysis.planners):
        spread: Spread = getattr(one, field)
        row = [planner(k, one.label), Cell(str(spread.runs), spread.runs), within(spread.median)]
        for p, value in zip(PERCENTILES, spread.percentiles, strict=True):
            few = spread.runs * (100 - p) < 100
            tip = f"of fewer than {100 // (100 - p)} runs: little more than the largest" if few and spread.runs else ""
            row.append(Cell(number(value), value, "few" if tip else "", tip))
        rows.append(row)
    return table(heads, rows)


def parts(analysis: Analysis, found: Sequence[SubsetSummary]) -> str:
    """Success, median planning time and ratio of every planner on parts of the problems, side by side."""
    heads = [Head("planner", words=True)]
    heads += [Head(f"{part.name} ({part.problems})", f"{part.name}: {part.problems} problems") for part in found]
    rows = []
    for k, label in enumerate(analysis.runs.planners):
        rows.append([planner(k, label), *(_part(part, k) for part in found)])
    return table(heads, rows)


def _part(part: SubsetSummary, k: int) -> Cell:
    share, seconds, ratio = part.success[k], part.plan_time[k], part.ratio[k]
    if math.isnan(share.value):
        return Cell(NOTHING, kind="none")
    more = "" if math.isnan(seconds) else f"<br><small>{number(seconds)} s · {number(ratio)}</small>"
    known = not math.isnan(share.low)
    ends = f"verified {percent(share.low)} to {percent(share.high)} with 95 % confidence"
    tip = ends if known else "of fewer than 5 problems: no interval"
    return _shaded(f"{percent(share.value)}{more}", share.value, tip)


def _shaded(text: str, share: float, tip: str) -> Cell:
    return Cell(f'<span class=heat style="--share:{share:.2f}">{text}</span>', share, "heated", tip)


def pair_table(analysis: Analysis) -> str:
    """Every two planners on what both solve."""
    heads = [
        Head("first", words=True),
        Head("second", words=True),
        Head("problems", "solved by both"),
        Head("only first", "runs that only the first one solved"),
        Head("only second", "runs that only the second one solved"),
    ]
    for what in ("time", "duration"):
        heads += [
            Head(f"{what} ratio", "median of first / second, below 1: the first one costs less"),
            Head("wins : losses", "problems on which the first costs less : more, beyond 1 %"),
            Head("p sign", "how likely by chance: sign test, raw"),
            Head("Holm", "the same, corrected by Holm for all pairs"),
            Head("p rank", "how likely by chance: Wilcoxon's signed ranks, raw"),
            Head("Holm", "the same, corrected by Holm for all pairs"),
        ]
    numbers = {label: k for k, label in enumerate(analysis.runs.planners)}
    fields = [(what, test) for what in ("plan_time", "duration") for test in ("sign", "rank")]
    corrected = [holm([getattr(getattr(pair, what), test) for pair in analysis.pairs]) for what, test in fields]
    rows = zip(analysis.pairs, zip(*corrected, strict=True), strict=True)
    return table(heads, [_pair(numbers, pair, chances) for pair, chances in rows])


def _pair(numbers: dict[str, int], pair: PlannerPair, corrected: tuple[float, ...]) -> list[Cell]:
    """A row; `corrected`: of planning time by sign and rank, of duration likewise."""
    names = [planner(numbers[label], label) for label in (pair.first, pair.second)]
    counts = [Cell(str(value), value) for value in (pair.problems, pair.only_first, pair.only_second)]
    return [*names, *counts, *_paired(pair.plan_time, corrected[:2]), *_paired(pair.duration, corrected[2:])]


def _paired(one: Paired, corrected: tuple[float, ...]) -> list[Cell]:
    score = Cell(f"{one.wins} : {one.losses}", one.wins - one.losses)
    chances = [
        Cell(probability(p), p, kind)
        for raw, sure in zip((one.sign, one.rank), corrected, strict=True)
        for p, kind in ((raw, ""), (sure, "sure" if sure < 0.05 else ""))
    ]
    return [within(one.ratio), score, *chances]


def matrix(analysis: Analysis, field: str) -> str:
    """Median ratios row / column on commonly solved problems: `plan_time` or `duration`."""
    labels = analysis.runs.planners
    found = {(pair.first, pair.second): (getattr(pair, field), pair.problems) for pair in analysis.pairs}
    corrected = dict(zip(found, holm([compared.rank for compared, _ in found.values()]), strict=True))
    heads = [Head("row / column", words=True), *(Head(label) for label in labels)]
    rows = []
    for k, row in enumerate(labels):
        cells = [planner(k, row)]
        for column in labels:
            pair = (row, column) if (row, column) in found else (column, row)
            if pair not in found:
                cells.append(Cell("", kind="none"))
                continue
            compared, problems = found[pair]
            value = compared.ratio.value if pair == (row, column) else 1.0 / compared.ratio.value
            cells.append(_ratio_cell(value, corrected[pair], problems))
        rows.append(cells)
    return table(heads, rows)


def _ratio_cell(value: float, p: float, problems: int) -> Cell:
    if math.isnan(value):
        return Cell(NOTHING, kind="none")
    kind = ("less" if value < 1.0 else "more") if p < 0.05 and abs(math.log(value)) > TIE else ""
    return Cell(number(value), value, kind, f"on {problems} problems; p = {p:.2g}, corrected")
