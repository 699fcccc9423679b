"""Pages of the viewer that play in the documentation: a proof, a failure, a comparison, planned when the site is made.

Those of the source reports are made with the pages that show them, `report_pages.py`.

MkDocs calls `on_files` before it reads the pages (`hooks:` in mkdocs.yml).
"""

from collections.abc import Mapping
from functools import cache

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

import optiplan as op
from optiplan.viewer.page import render_page
from optiplan.viewer.runs import ViewedRun
from optiplan.viewer.scene import build_scene

PROBLEM = "02_shelf"
PAGES: Mapping[str, tuple[str, ...]] = {
    "proof": ("trajopt",),
    "failure": ("quintic",),
    "comparison": ("trajopt", "rrtconnect", "kpiece", "prm", "quintic", "circle"),
}
"""Planners of each page."""
BUDGET = 1.0  # s for each planner, most of which improve their answer as long as it lasts


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add `live/NAME.html`, which the how-to about the browser shows in frames."""
    for name, text in live_pages().items():
        files.append(File.generated(config, f"live/{name}.html", content=text))
    return files


@cache
def live_pages() -> Mapping[str, str]:
    """The text of each page."""
    problem = op.load_problem(PROBLEM)
    return {
        page: render_page(build_scene(problem, [_viewed(problem, planner) for planner in planners]))
        for page, planners in PAGES.items()
    }


@cache
def _viewed(problem: op.Problem, planner: str) -> ViewedRun:
    try:
        run = op.plan(problem, planner, budget=BUDGET)
    except op.InputError as error:
        return ViewedRun(planner, None, None, {"kind": "input", "detail": str(error)})
    return ViewedRun.of(run, planner)
