"""The page: one self-contained HTML file."""

import base64
import html
import shlex
import zlib
from collections.abc import Callable, Sequence
from importlib import resources
from pathlib import Path
from string import Template
from typing import NamedTuple
from urllib.parse import quote

from optiplan.bench.report.analysis import Analysis, SubsetSummary, analyse_results
from optiplan.bench.report.failures import REASONS, Failed, Reason, reasons
from optiplan.bench.report.figures import figures, inline_svg, measure_figures
from optiplan.bench.report.headline import Card, cards, facts, warnings
from optiplan.bench.report.matrix import MOST_PROBLEMS, Address, ProblemRow, matrix_html, matrix_rows
from optiplan.bench.report.settings import settings
from optiplan.bench.report.show import PAGES, write_comparisons, write_scenes
from optiplan.bench.report.tables.cells import ReportTable, planner
from optiplan.bench.report.tables.formats import as_csv, as_latex
from optiplan.bench.report.tables.measure_tables import measure_table, problem_table, quality_table
from optiplan.bench.report.tables.pair_tables import pair_table, ratio_table
from optiplan.bench.report.tables.planner_tables import ladder, parts, percentiles
from optiplan.bench.results.database import Store
from optiplan.bench.results.growth import place_of
from optiplan.bench.results.measures import load_results
from optiplan.errors import counted
from optiplan.files import write_text
from optiplan.planners.base import Progress, silent

FILE = "report.html"
MOST_SETS = 12
"""Sets that have views of their own."""

OF_SETS = ("success-over-time", "quality-over-time", "duration-ratio")
"""Figures that a set has of its own."""

Link = Callable[[Failed], str | None]
"""Where a failure can be looked at; None where only a command shows it."""


class Links(NamedTuple):
    """Where a page leads to: a failure, and the runs of a problem together."""

    failure: Link
    problem: Address


def write_page(
    store: Store, analysis: Analysis, path: Path | None = None, pages: int = PAGES, progress: Progress = silent
) -> Path:
    """Write the report of a suite's results whole or not at all, and pages of the viewer beside it.

    Args:
        store: the results.
        analysis: of them.
        path: `report.html` beside the database unless given.
        pages: problems that have a page of all their planners, of those in the matrix, the first ones.
        progress: told what is drawn.
    """
    path = path or store.folder / FILE
    found, rows = reasons(store), matrix_rows(store, analysis, progress)
    compared = write_comparisons(store, [(row.name, row.keys()) for row in rows[:pages]], path, progress)
    links = Links(write_scenes(store, found, path).get, compared.get)
    write_text(path, render(store, analysis, found, rows, links))
    return path


def render(store: Store, analysis: Analysis, found: list[Reason], rows: Sequence[ProblemRow], links: Links) -> str:
    """Return the page as text; all values from the results are escaped."""
    own = resources.files("optiplan.bench.report")
    return Template((own / "report.html").read_text("utf-8")).substitute(
        title=html.escape(str(store.meta("name"))),
        style=(own / "report.css").read_text("utf-8"),
        script=(own / "report.js").read_text("utf-8"),
        facts=html.escape(facts(store, analysis)),
        warnings="".join(f"<p class=warning>{html.escape(text)}</p>" for text in warnings(store, analysis)),
        filters=_filters(analysis),
        cards="".join(map(_card, cards(analysis))),
        views=_views(store, analysis),
        matrix=_matrix(store, analysis, rows, links.problem),
        measures=_figures(analysis, measure=True),
        parts=_parts(analysis),
        problems=_problems(analysis, [row.name for row in rows]),
        pairs=_pairs(analysis),
        failures=_failures(store, found, links.failure),
        settings=settings(store),
    )


def all_tables(analysis: Analysis) -> list[ReportTable]:
    """Every table of the report, those of single problems too."""
    found = _tables(analysis) + [parts(analysis, some, what) for what, some in _subsets(analysis)]
    if analysis.pairs:
        found += [ratio_table(analysis, field) for field in ("duration", "plan_time")] + [pair_table(analysis)]
    return found + [problem_table(analysis, k) for k in range(len(analysis.runs.problems))]


def framed(table: ReportTable) -> str:
    """A table with its files behind it."""
    links = " ".join(
        f'<a download="{html.escape(table.name)}.{suffix}" href="data:{kind};charset=utf-8,{quote(text)}">{words}</a>'
        for suffix, kind, words, text in (
            ("csv", "text/csv", "CSV", as_csv(table)),
            ("tex", "text/x-tex", "LaTeX", as_latex(table)),
        )
    )
    return f"{table.html()}<p class=files>{html.escape(table.caption)}: {links}</p>"


def hidden_html(text: str) -> str:
    """HTML that is not seen at first, as an attribute that the page's script unpacks when it is asked for.

    Deflate and base64 make a tenth of it, and a browser has no elements to lay out that nobody looks at.
    """
    return f'data-packed="{base64.b64encode(zlib.compress(text.encode(), 9)).decode("ascii")}"'


def _tables(analysis: Analysis) -> list[ReportTable]:
    """Tables with a row a planner."""
    costs = [percentiles(analysis, field) for field in ("plan_time", "ratio")]
    return [ladder(analysis), quality_table(analysis), measure_table(analysis), *costs]


def _views(store: Store, analysis: Analysis) -> str:
    """Tables and figures of all runs, and those of each set, hidden until it is asked for."""
    text = f'<div class=view data-view="">{_view(analysis, "", "")}</div>'
    names = list(dict.fromkeys(analysis.runs.sets))
    if not 2 <= len(names) <= MOST_SETS:
        return text
    results = load_results(store)
    for k, name in enumerate(names):
        inside = _view(analyse_results(results.of_set(name), compared=False), name, f"set{k}-")
        text += f'<div class=view data-view="{html.escape(name)}" hidden {hidden_html(inside)}></div>'
    return text


def _view(analysis: Analysis, set_name: str, prefix: str) -> str:
    first, *others = _tables(analysis)
    tables = "".join(f"<h3>{html.escape(one.caption)}</h3>{framed(one)}" for one in others)
    of = f" of set {html.escape(set_name)}" if set_name else ""
    return (
        f"<h2>Planners{of}</h2>{framed(first)}"
        f"<h2>Figures{of}</h2><p class=note>Point at a planner's name, in a table, to single it out in the figures.</p>"
        f"<div class=grid>{_figures(analysis, prefix)}</div><h2>Tables{of}</h2>{tables}"
    )


def _filters(analysis: Analysis) -> str:
    names = list(dict.fromkeys(analysis.runs.sets))
    shown = names if 2 <= len(names) <= MOST_SETS else []
    options = "".join(f"<option>{html.escape(name)}</option>" for name in shown)
    sets = f'<label>Set <select id=set><option value="">all</option>{options}</select></label>' if shown else ""
    chips = "".join(
        f"<label class=chosen><input type=checkbox checked data-show={k}>{planner(k, label).html}</label>"
        for k, label in enumerate(analysis.runs.planners)
    )
    return f'{sets}<span class=chips role=group aria-label="Planners that are shown">{chips}</span>'


def _card(card: Card) -> str:
    heading, answer, reason = card
    return f"<div class=card><h3>{heading}</h3><p class=big>{answer}</p><p>{reason}</p></div>"


def _figures(analysis: Analysis, prefix: str = "", measure: bool = False) -> str:
    return "\n".join(
        f'<figure id="{prefix}figure-{figure.name}"><h3>{html.escape(figure.title)}</h3>'
        f"{inline_svg(figure, analysis, prefix)}<figcaption>{html.escape(figure.caption)}</figcaption></figure>"
        for figure in (measure_figures(analysis) if measure else figures(analysis))
        if not prefix or figure.name in OF_SETS
    )


def _matrix(store: Store, analysis: Analysis, rows: Sequence[ProblemRow], address: Address) -> str:
    if not rows:
        return "<p class=note>No runs yet.</p>"
    every = sum(1 for k in range(len(analysis.runs.problems)) if (analysis.runs.problem == k).any())
    some = f"The {MOST_PROBLEMS} of {every} problems on which planners differ most. " if every > len(rows) else ""
    linked = sum(1 for row in rows if address(row.name))
    why = "" if linked == len(rows) else _few_pages(linked, len(rows))
    return f"<p class=note>{some}{MATRIX}{why}</p>{matrix_html(store, analysis, rows, address)}"


def _few_pages(linked: int, rows: int) -> str:
    """Why not every row of the matrix can be opened from a file, and how it can."""
    return (
        f" <b>{linked} of {rows} rows open with a click.</b> A page of all planners measures and proves every motion "
        "again, which takes seconds and a megabyte or two a problem, so only the first rows have one beside this file. "
        f"<code>optiplan bench report DIR --pages {rows}</code> writes all of them, <code>optiplan bench report DIR "
        "--serve</code> makes each when it is asked for, and a tick in a cell gives the command that opens it."
    )


MATRIX = (
    "The scene with the robot at its start and the path of its tool; the time is that of the motion. Tick some of a "
    "row to compare them."
)


def _subsets(analysis: Analysis) -> list[tuple[str, Sequence[SubsetSummary]]]:
    return [(what, some) for what, some in (("set", analysis.sets), ("difficulty", analysis.difficulties)) if some]


def _parts(analysis: Analysis) -> str:
    note = "<p class=note>Share of verified runs; below it median planning time and median duration / bound.</p>"
    return note + "".join(
        f"<h3>By {what}</h3>{framed(parts(analysis, some, what))}" for what, some in _subsets(analysis)
    )


def _problems(analysis: Analysis, names: Sequence[str]) -> str:
    runs = analysis.runs
    text = ""
    for name in names:
        number = runs.problems.index(name)
        table = framed(problem_table(analysis, number))
        of_set = html.escape(runs.sets[number])
        text += f'<details data-set="{of_set}" {hidden_html(table)}><summary>{html.escape(name)}</summary></details>'
    return text


def _pairs(analysis: Analysis) -> str:
    if not analysis.pairs:
        return "<p class=note>There is but one planner.</p>"
    text = ""
    for field, what in (("duration", "Duration of the motion"), ("plan_time", "Planning time")):
        text += f"<h3>{what}: median ratio, row / column</h3>{framed(ratio_table(analysis, field))}"
    every = hidden_html(framed(pair_table(analysis)))
    return f"{text}<details {every}><summary>Every pair with its counts and tests</summary></details>"


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
    problems = counted(reason.problems, "problem")
    return (
        f"<details class=reason><summary><b>{reason.runs}</b> <span class=kind>{html.escape(reason.kind)}</span> "
        f"{html.escape(reason.words)}</summary><p>{planners} · on {problems}</p>{which}<ul>{items}</ul></details>"
    )


def _example(store: Store, run: Failed, address: str | None) -> str:
    folder, key = place_of(store, run.key)
    command = shlex.join(["optiplan", "bench", "show", folder, *map(str, key)])
    opened = f'<a href="{html.escape(address)}">open scene{" and witness" if run.seen else ""}</a> ' if address else ""
    seen = "" if run.seen else " <small>no witness</small>"
    return (
        f"<li>{html.escape(run.planner)} on <b>{html.escape(run.problem)}</b>, seed {run.seed}, "
        f"repetition {run.repetition}: {html.escape(run.detail)}{seen}<br>{opened}"
        f"<code>{html.escape(command)}</code> <button class=copy>copy</button></li>"
    )
