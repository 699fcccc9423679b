"""A table as CSV, with full precision, and as LaTeX, as it is shown."""

import csv
import io
from collections.abc import Sequence
from pathlib import Path

from optiplan.bench.report.tables.cells import ReportTable
from optiplan.files import write_text

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


def as_csv(table: ReportTable) -> str:
    """Values as they are sorted by, with two columns more, `low` and `high`, where a column has intervals."""
    has = [any(row[k].interval for row in table.rows) for k in range(len(table.heads))]
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    heads: list[str] = []
    for head, interval in zip(table.heads, has, strict=True):
        heads += [head.text, f"{head.text} low", f"{head.text} high"] if interval else [head.text]
    writer.writerow(heads)
    for row in table.rows:
        values: list[object] = []
        for cell, interval in zip(row, has, strict=True):
            values.append(cell.key if cell.known else "")
            values += (cell.interval or ("", "")) if interval else ()
        writer.writerow(values)
    return text.getvalue()


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


def _line(cells: Sequence[str]) -> str:
    return " & ".join(map(escaped, cells)) + r" \\"
