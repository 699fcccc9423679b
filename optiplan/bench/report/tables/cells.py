"""What tables are made of. Every value is escaped here; a cell holds its sort key and, if it has one, its interval."""

import html
import math
import re
from collections.abc import Sequence
from typing import NamedTuple

from optiplan.bench.statistics.intervals_and_tests import Interval
from optiplan.figure_style import COLOURS, line_of

NOTHING = "–"
BOUND = "one bound a problem: the least over the end configurations that were reached or that it lists"
_TAG = re.compile(r"<[^>]*>")

FEW = " <small class=interval>few</small>"
NO_INTERVAL = "of fewer than 5 problems: no interval"


class Cell(NamedTuple):
    """A cell: its HTML, what it is sorted by (None: nothing there), its class, its tip, the interval of its value."""

    html: str
    key: float | str | None = None
    kind: str = ""
    tip: str = ""
    interval: tuple[float, float] | None = None

    @property
    def text(self) -> str:
        """What it says, without marks."""
        return " ".join(html.unescape(_TAG.sub(" ", self.html)).split())

    @property
    def known(self) -> bool:
        """Whether there is a value."""
        return self.key is not None and not (isinstance(self.key, float) and math.isnan(self.key))


class Head(NamedTuple):
    """Heading of a column, what it means, whether it holds text, and the number of the planner that it is of."""

    text: str
    tip: str = ""
    words: bool = False
    planner: int | None = None


class ReportTable(NamedTuple):
    """A table: name of its files, what it shows in a sentence, headings, rows."""

    name: str
    caption: str
    heads: Sequence[Head]
    rows: Sequence[Sequence[Cell]]

    def html(self) -> str:
        """A table that can be sorted by any column."""
        top = "".join(
            f'<th scope="col"{" class=words" if head.words else ""}{_tip(head.tip)}{_of_planner(head.planner)}>'
            f"<button>{html.escape(head.text)}</button></th>"
            for head in self.heads
        )
        lines = ("".join(_cell(cell, head) for cell, head in zip(row, self.heads, strict=True)) for row in self.rows)
        body = "\n".join(f"<tr>{line}</tr>" for line in lines)
        name = html.escape(self.caption)
        return (
            f'<div class=scroll tabindex=0 role=region aria-label="{name}"><table class=sortable>'
            f"<thead><tr>{top}</tr></thead><tbody>{body}</tbody></table></div>"
        )


def _cell(cell: Cell, head: Head) -> str:
    kind = " ".join(part for part in ("words" if head.words else "", cell.kind) if part)
    key = f' data-key="{html.escape(str(cell.key))}"' if cell.known else ""
    named = f' class="{kind}"' if kind else ""
    return f"<td{named}{key}{_tip(cell.tip)}{_of_planner(head.planner)}>{cell.html}</td>"


def _of_planner(number: int | None) -> str:
    return "" if number is None else f" data-column={number}"


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


def with_interval(value: Interval) -> Cell:
    """A median with its interval behind it."""
    if math.isnan(value.value):
        return Cell(NOTHING, kind="none")
    more, tip = FEW, f"median {NO_INTERVAL}"
    if value.ends is not None:
        more = f" <small class=interval>[{number(value.low)}, {number(value.high)}]</small>"
        tip = "median, 95 % confidence"
    return Cell(f"{number(value.value)}{more}", value.value, tip=tip, interval=value.ends)


def planner(k: int, label: str) -> Cell:
    """A planner's name with the line that it has in the figures."""
    number, dashes = k % len(COLOURS), line_of(k)[1]
    path = f'<path d="M0 3H22" style="stroke: var(--c{number})" stroke-dasharray="{_scaled(dashes)}"/>'
    chip = f'<svg class=chip viewBox="0 0 22 6" aria-hidden="true">{path}</svg>'
    return Cell(f'<span class=planner data-planner="{k}">{chip}{html.escape(label)}</span>', label)


def _scaled(dashes: str) -> str:
    return " ".join(f"{2.2 * float(length):g}" for length in dashes.split())


def share(value: Interval) -> Cell:
    """A share with its interval."""
    if math.isnan(value.value):
        return Cell(NOTHING, kind="none")
    ends = FEW if value.ends is None else f" <small class=interval>{_percents(value)}</small>"
    return Cell(f"{percent(value.value)}{ends}", value.value, tip=_certainty(value), interval=value.ends)


def success(value: Interval) -> Cell:
    """A share as a bar with its number and interval."""
    if math.isnan(value.value):
        return Cell(NOTHING, kind="none")
    bar = f'<span class=bar><i style="width:{100.0 * value.value:.1f}%"></i></span>'
    more = FEW if value.ends is None else f"<small>{_percents(value)}</small>"
    shown = f"{bar}<b>{percent(value.value)}</b> {more}"
    return Cell(shown, value.value, "success", _certainty(value), value.ends)


def _percents(value: Interval) -> str:
    return f"[{100.0 * value.low:.0f}, {100.0 * value.high:.0f}]"


def _certainty(value: Interval) -> str:
    return NO_INTERVAL if value.ends is None else "95 % confidence, by problems"
