"""Tables of pairs of planners, on the problems that both solve."""

import math

from optiplan.bench.report.analysis import Analysis
from optiplan.bench.report.pairs import Paired, PlannerPair
from optiplan.bench.report.tables.cells import (
    NOTHING,
    Cell,
    Head,
    ReportTable,
    number,
    planner,
    probability,
    with_interval,
)
from optiplan.bench.statistics.intervals_and_tests import ALPHA, TIE, holm


def pair_table(analysis: Analysis) -> ReportTable:
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
    return ReportTable("pairs", "Every two planners on what both solve", heads, [_pair(numbers, *row) for row in rows])


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
        for p, kind in ((raw, ""), (sure, "sure" if sure < ALPHA else ""))
    ]
    return [with_interval(one.ratio), score, *chances]


def ratio_table(analysis: Analysis, field: str) -> ReportTable:
    """Median ratios row / column on commonly solved problems: `plan_time` or `duration`."""
    labels = analysis.runs.planners
    found = {(pair.first, pair.second): (getattr(pair, field), pair.problems) for pair in analysis.pairs}
    corrected = dict(zip(found, holm([compared.rank for compared, _ in found.values()]), strict=True))
    heads = [Head("row / column", words=True), *(Head(label, planner=k) for k, label in enumerate(labels))]
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
    what = {"plan_time": "planning time", "duration": "duration of the motion"}[field]
    return ReportTable(f"pairs-{field}", f"Median ratio of {what}, row / column, on what both solve", heads, rows)


def _ratio_cell(value: float, p: float, problems: int) -> Cell:
    if math.isnan(value):
        return Cell(NOTHING, kind="none")
    kind = ("less" if value < 1.0 else "more") if p < ALPHA and abs(math.log(value)) > math.log1p(TIE) else ""
    return Cell(number(value), value, kind, f"on {problems} problems; p = {p:.2g}, corrected")
