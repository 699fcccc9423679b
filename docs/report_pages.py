"""Pages of the source reports: figure, live arm, printed and right numbers as exercises; and the lessons as pages.

MkDocs calls `on_files` before it reads the pages (`hooks:` in mkdocs.yml). Numbers and commands come from the files
of `benchmarks/reports`, whose right numbers a test compares with `tests/reference`; figures and arms are
planned when the site is made.
"""

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

import optiplan as op
from optiplan.config.document import read_yaml
from optiplan.figure_style import svg_of
from optiplan.viewer.page import render_page
from optiplan.viewer.runs import ViewedRun
from optiplan.viewer.scene import build_scene

ROOT = Path(__file__).parent.parent
ROWS, EXERCISES = (ROOT / "benchmarks" / "reports" / f"{name}.yaml" for name in ("rows", "exercises"))
LESSONS = ROOT / "examples" / "lessons"
BUDGET = 15.0  # s for a motion
_FIGURE = re.compile(r'op\.plot\(figure=\\?"(\w+)\\?", style=\\?"textbook\\?"\)')  # in a cell, or in its JSON


@dataclass(frozen=True)
class ReportPage:
    """A page: its heading, first sentences, problem, figure of its run, problem that plays, what it shows, lessons."""

    heading: str
    intro: str
    problem: str
    figure: str
    live: str
    shows: str
    lessons: tuple[str, ...]


PAGES: Mapping[str, ReportPage] = {
    "srra": ReportPage(
        "SRRA: the arm with the spherical reach",
        "Recompute the worked example of the SRRA report, find its slips, and see its arm pass its own base.",
        "15_srra",
        "singularities",
        "15_srra",
        "Its three singularities. The C-shaped link changes none of them.",
        ("c_shaped_link", "wrist_singularity"),
    ),
    "delbot": ReportPage(
        "Delbot: the arm on mecanum wheels",
        "Recompute poses, Jacobian and circle of the Delbot report, and find out what its wheels can do.",
        "27_circle",
        "path",
        "27_circle",
        "The circle, which closes.",
        ("mecanum_base",),
    ),
    "lecture": ReportPage(
        "Lecture: time laws, two links, PUMA 560",
        "Work through the lecture's examples: which of its curves hold, and which of its numbers do not.",
        "19_lspb",
        "laws",
        "20_puma_quintic",
        "Example 4 by five time laws, in the same time.",
        ("lspb_bounds", "wrist_singularity"),
    ),
    "baxter": ReportPage(
        "Baxter: the arm of the screw motion report",
        "Follow the report's screws, with its matrix as printed and as it should be.",
        "30_screw_report_a",
        "path",
        "30_screw_report_a",
        "Experiment a: the hand along one screw.",
        ("sclerp_corrected",),
    ),
}


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add `seeds/REPORT.md` with its figure, `live/REPORT.html`, which it shows in a frame, and `lessons/NAME.md`."""
    for name, page in PAGES.items():
        files.append(File.generated(config, f"seeds/{name}.svg", content=figure(page)))
        files.append(File.generated(config, f"seeds/{name}.md", content=report_page(name)))
        files.append(File.generated(config, f"live/{name}.html", content=live_page(page)))
    for path in sorted(LESSONS.glob("*.ipynb")):
        files.append(File.generated(config, f"lessons/{path.stem}.md", content=lesson(path)))
        for name in _FIGURE.findall(path.read_text("utf-8")):
            drawn = svg_of(op.plot(figure=name, style="textbook"))
            files.append(File.generated(config, f"lessons/{name}.svg", content=drawn))
    return files


@cache
def rows(path: Path) -> list[dict[str, Any]]:
    """The rows of a file, of all reports."""
    found: list[dict[str, Any]] = read_yaml(path).data
    return found


@cache
def planned(problem: str) -> op.Run:
    """The motion of a page: its figure and what plays are of the same one, where they are of the same problem."""
    return op.plan(op.load_problem(problem), budget=BUDGET)


def figure(page: ReportPage) -> str:
    """The figure of a page, as SVG."""
    return svg_of(op.plot(planned(page.problem), figure=page.figure, style="textbook"))


def live_page(page: ReportPage) -> str:
    """The viewer with the motion of a page."""
    problem = op.load_problem(page.live)
    return render_page(build_scene(problem, [ViewedRun.of(planned(page.live), problem.planner)]))


def report_page(name: str) -> str:
    """The page of a report."""
    page, own = PAGES[name], [row for row in rows(ROWS) if row["report"] == name]
    wrong = [row for row in own + rows(EXERCISES) if row["report"] == name and row.get("ask")]
    text = [
        f"# {page.heading}",
        page.intro,
        "The numbers are recomputed; [the reports behind the robots](../theory/reports.md) has all, with reasons.",
        f"![{page.shows}]({name}.svg)",
        f"{page.shows} `optiplan plan {page.problem} --out runs/{name}`, then "
        f"`optiplan plot runs/{name} --style textbook --figure {page.figure}`.",
        f'<iframe class="tall" src="../live/{name}.html#panel=dock" title="{page.heading}, with its proof" '
        'loading="lazy"></iframe>',
        f"[The arm on a page of its own](../live/{name}.html), planned and proved when this site was made.",
        "## Exercises",
        "Each printed number is another than the right one. Work it out, then open the answer.",
    ]
    for number, row in enumerate(wrong, 1):
        text += [f"### {number}. {plain(row['what'][0].upper() + row['what'][1:])}", plain(row["ask"])]
        text += [f"The report has: {plain(row['printed'])}.", answer(row)]
    text += ["## What the report describes, and its command", table(own), "## Lessons"]
    text += [f"- [{title(LESSONS / f'{one}.ipynb')}](../lessons/{one}.md)" for one in page.lessons]
    return "\n\n".join(text) + "\n"


def plain(text: Any) -> str:
    """Text in which asterisks are themselves, such as θ*; code in it stays as it is."""
    return "`".join(part if k % 2 else part.replace("*", "\\*") for k, part in enumerate(str(text).split("`")))


def answer(row: Mapping[str, Any]) -> str:
    """The answer of an exercise, folded."""
    code = f"```python\n{row['python'].rstrip()}\n```" if row.get("python") else f"```sh\n{row['run']}\n```"
    lines = [f"Right: **{plain(row['right'])}**. {plain(row['why'])}", "", *code.splitlines()]
    return "\n".join(['??? question "Answer"', *(f"    {line}".rstrip() for line in lines)])


def table(own: list[dict[str, Any]]) -> str:
    """All rows of a report: what, and how."""
    lines = ["| what | here |", "|---|---|"]
    for row in own:
        how = "Python, in its exercise or row" if row.get("python") else f"`{row['run']}`" if row.get("run") else ""
        how = how or f"missing: {row['missing']}"
        lines.append(f"| {plain(row['what'])} | {how.replace('|', chr(92) + '|').replace('{out}/', '')} |")
    return "\n".join(lines)


def title(path: Path) -> str:
    """The heading of a lesson."""
    return "".join(json.loads(path.read_text("utf-8"))["cells"][0]["source"]).splitlines()[0].lstrip("# ")


def lesson(path: Path) -> str:
    """A notebook as a page: words, code, and what the code shows."""
    text = []
    for cell in json.loads(path.read_text("utf-8"))["cells"]:
        source = "".join(cell["source"])
        if cell["cell_type"] == "markdown":
            text.append(source)
            continue
        text.append(f"```python\n{source}\n```")
        for output in cell["outputs"]:
            shown = output.get("text") or output["data"]["text/plain"]
            text.append(f"```text\n{''.join(shown).rstrip()}\n```")
        text += [f"![The figure `{name}`]({name}.svg)" for name in _FIGURE.findall(source)]
    text.insert(1, f"A notebook: `examples/lessons/{path.name}`, run by the tests.")
    return "\n\n".join(text) + "\n"
