"""The page: one self-contained HTML file."""

import html
import shlex
from collections.abc import Callable
from importlib import resources
from pathlib import Path
from string import Template

from optiplan.bench.report import tables
from optiplan.bench.report.analysis import Analysis
from optiplan.bench.report.failures import REASONS, Failed, Reason, reasons
from optiplan.bench.report.figures import figures, inline_svg
from optiplan.bench.report.headline import Card, cards, facts, warnings
from optiplan.bench.report.scenes import write_scenes
from optiplan.bench.report.settings import settings
from optiplan.bench.results.database import Store
from optiplan.files import write_text

FILE = "report.html"

Link = Callable[[Failed], str | None]
"""Where a run can be looked at; None where only a command shows it."""


def write_page(store: Store, analysis: Analysis, path: Path | None = None) -> Path:
    """Write the report of a suite's results whole or not at all, and scenes of failures beside it.

    Args:
        store: the results.
        analysis: of them.
        path: `report.html` beside the database unless given.
    """
    path = path or store.folder / FILE
    found = reasons(store)
    text = render(store, analysis, found, write_scenes(store, found, path).get)
    write_text(path, text)
    return path


def render(store: Store, analysis: Analysis, found: list[Reason], link: Link) -> str:
    """Return the page as text; all values from the results are escaped."""
    own = resources.files("optiplan.bench.report")
    name = str(store.meta("name"))
    return Template((own / "report.html").read_text("utf-8")).substitute(
        title=html.escape(name),
        style=(own / "report.css").read_text("utf-8"),
        script=(own / "report.js").read_text("utf-8"),
        facts=html.escape(facts(store, analysis)),
        warnings="".join(f"<p class=warning>{html.escape(text)}</p>" for text in warnings(store, analysis)),
        cards="".join(map(_card, cards(analysis))),
        ladder=tables.ladder(analysis),
        figures=_figures(analysis),
        times=tables.percentiles(analysis, "plan_time"),
        ratios=tables.percentiles(analysis, "ratio"),
        parts=_parts(analysis),
        pairs=_pairs(analysis),
        failures=_failures(store, found, link),
        settings=settings(store),
    )


def _card(card: Card) -> str:
    heading, answer, reason = card
    return f"<div class=card><h3>{heading}</h3><p class=big>{answer}</p><p>{reason}</p></div>"


def _figures(analysis: Analysis) -> str:
    return "\n".join(
        f'<figure id="figure-{figure.name}"><h3>{html.escape(figure.title)}</h3>{inline_svg(figure, analysis)}'
        f"<figcaption>{html.escape(figure.caption)}</figcaption></figure>"
        for figure in figures(analysis)
    )


def _parts(analysis: Analysis) -> str:
    note = "<p class=note>Share of verified runs; below it median planning time and median duration / bound.</p>"
    found = [("set", analysis.sets), ("difficulty", analysis.difficulties)]
    return note + "".join(f"<h3>By {what}</h3>{tables.parts(analysis, part)}" for what, part in found if part)


def _pairs(analysis: Analysis) -> str:
    if not analysis.pairs:
        return "<p class=note>There is but one planner.</p>"
    text = ""
    for field, what in (("duration", "Duration of the motion"), ("plan_time", "Planning time")):
        text += f"<h3>{what}: median ratio, row / column</h3>{tables.matrix(analysis, field)}"
    more = f"<details><summary>Every pair with its counts and tests</summary>{tables.pair_table(analysis)}</details>"
    return text + more


def _failures(store: Store, found: list[Reason], link: Link) -> str:
    if not found:
        return "<p class=good>None.</p>"
    text = "".join(_reason(store, reason, link) for reason in found[:REASONS])
    rest = found[REASONS:]
    if rest:
        text += f"<p class=note>{len(rest)} more reasons, of {sum(one.runs for one in rest)} runs.</p>"
    return text


def _reason(store: Store, reason: Reason, link: Link) -> str:
    planners = ", ".join(f"{html.escape(label)} {count}" for label, count in reason.planners.items())
    shown = len(reason.examples)
    which = "" if shown == reason.runs else f"<p class=note>{shown} of {reason.runs} runs:</p>"
    items = "".join(_example(store, run, link(run)) for run in reason.examples)
    problems = f"{reason.problems} problem{'s' if reason.problems != 1 else ''}"
    return (
        f"<details class=reason><summary><b>{reason.runs}</b> <span class=kind>{html.escape(reason.kind)}</span> "
        f"{html.escape(reason.words)}</summary><p>{planners} · on {problems}</p>{which}<ul>{items}</ul></details>"
    )


def _example(store: Store, run: Failed, address: str | None) -> str:
    command = shlex.join(["optiplan", "bench", "show", str(store.folder), *map(str, run[:4])])
    opened = f'<a href="{html.escape(address)}">open scene{" and witness" if run.seen else ""}</a> ' if address else ""
    seen = "" if run.seen else " <small>no witness</small>"
    return (
        f"<li>{html.escape(run.planner)} on <b>{html.escape(run.problem)}</b>, seed {run.seed}, "
        f"repetition {run.repetition}: {html.escape(run.detail)}{seen}<br>{opened}"
        f"<code>{html.escape(command)}</code> <button class=copy>copy</button></li>"
    )
