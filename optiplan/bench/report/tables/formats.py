"""A table as CSV, with full precision, and as LaTeX, as it is shown; the results in a Markdown table."""

from collections.abc import Sequence
from pathlib import Path

from optiplan.bench.report.analysis import Analysis, PlannerNumbers
from optiplan.bench.report.tables.cells import NOTHING, ReportTable, number, percent
from optiplan.bench.statistics.intervals_and_tests import Interval
from optiplan.files import csv_text, write_text

SPECIAL = {
    "\\": r"\textbackslash{}",
    "&": r"\&",
    "%": r"\%",
    "$": r"\$",
    "#": r"\#",
    "_": r"\_",
    "{": r"\{",
    "}": r"\}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "–": "--",
    "×": r"$\times$",
    "·": r"$\cdot$",
    "²": r"$^2$",
    "³": r"$^3$",
    "<": r"$<$",
    ">": r"$>$",
}
"""What LaTeX has a meaning of its own for, or no letter, and how to write it."""

MARKDOWN_HEADS = (
    *("planner", "runs", "planned", "timed", "verified", "95 % confidence"),
    *("planning time, s", "95 % of them", "processor, s", "duration / bound", "quickest", "shortest"),
)
MARKDOWN_NOTE = """
Verified: proved free of collisions and within all limits, of all runs; its 95 % interval is of resampled problems.
Planning time (clock), processor time of planning and duration / bound: median of verified runs with its 95 % bootstrap
interval. The bound is one for each problem, the least over the end configurations that were reached or that it lists.
Quickest, shortest: share of tasks on which no planner was better.
"""


def as_csv(table: ReportTable) -> str:
    """Values as they are sorted by, with two columns more, `low` and `high`, where a column has intervals."""
    has = [any(row[k].interval for row in table.rows) for k in range(len(table.heads))]
    heads, rows = list[str](), list[list[object]]()
    for head, interval in zip(table.heads, has, strict=True):
        heads += [head.text, f"{head.text} low", f"{head.text} high"] if interval else [head.text]
    for row in table.rows:
        values: list[object] = []
        for cell, interval in zip(row, has, strict=True):
            values.append(cell.key if cell.known else "")
            values += (cell.interval or ("", "")) if interval else ()
        rows.append(values)
    return csv_text(heads, rows)


def as_latex(table: ReportTable) -> str:
    r"""A `table` with its caption, for `\usepackage{booktabs}`; what is words is on the left, numbers on the right."""
    columns = "".join("l" if head.words else "r" for head in table.heads)
    lines = [_line([head.text for head in table.heads]), r"\midrule"]
    lines += [_line([cell.text for cell in row]) for row in table.rows]
    body = "\n".join(lines)
    return (
        "\\begin{table}\n\\centering\n"
        f"\\caption{{{escaped(table.caption)}}}\n\\label{{tab:{table.name}}}\n"
        f"\\begin{{tabular}}{{{columns}}}\n\\toprule\n{body}\n\\bottomrule\n\\end{{tabular}}\n\\end{{table}}\n"
    )


def escaped(text: str) -> str:
    """Text that LaTeX prints as it is."""
    return "".join(SPECIAL.get(letter, letter) for letter in text)


def write_tables(tables: Sequence[ReportTable], folder: Path) -> list[Path]:
    """Write every table as `<name>.csv` and `<name>.tex`."""
    written = []
    for table in tables:
        for suffix, text in (("csv", as_csv(table)), ("tex", as_latex(table))):
            written.append(folder / f"{table.name}.{suffix}")
            write_text(written[-1], text)
    return written


def markdown(analysis: Analysis) -> str:
    """The results as a Markdown table for READMEs, with a note; ends with a newline."""
    rows = [_markdown_row(one) for one in analysis.planners]
    lines = [list(MARKDOWN_HEADS), *rows]
    widths = [max(len(line[k]) for line in lines) for k in range(len(MARKDOWN_HEADS))]
    rule = ["-" * widths[0], *(f"{'-' * (width - 1)}:" for width in widths[1:])]
    text = "\n".join(f"| {' | '.join(_aligned(line, widths))} |" for line in [lines[0], rule, *rows])
    return f"{text}\n{MARKDOWN_NOTE}"


def _line(cells: Sequence[str]) -> str:
    return " & ".join(map(escaped, cells)) + r" \\"


def _markdown_row(one: PlannerNumbers) -> list[str]:
    shares = [percent(count / one.runs) if one.runs else NOTHING for count in (one.planned, one.timed, one.verified)]
    confidence = NOTHING if one.success.ends is None else " to ".join(map(percent, one.success.ends))
    costs = [_within(one.plan_time.median), number(one.plan_time.percentiles[2])]
    costs += [_within(one.plan_cpu.median), _within(one.ratio.median)]
    label = one.label.replace("|", "\\|")
    return [label, str(one.runs), *shares, confidence, *costs, percent(one.quickest), percent(one.shortest)]


def _within(value: Interval) -> str:
    return number(value.value) + ("" if value.ends is None else f" [{number(value.low)}, {number(value.high)}]")


def _aligned(line: list[str], widths: list[int]) -> list[str]:
    return [line[0].ljust(widths[0]), *(text.rjust(width) for text, width in zip(line[1:], widths[1:], strict=True))]
