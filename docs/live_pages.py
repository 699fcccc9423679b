"""Pages of the viewer that play in the documentation: a proof, a failure, a comparison, planned when the site is made.

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

PAGES: Mapping[str, tuple[str, tuple[str | None, ...]]] = {
    "proof": ("02_shelf", ("trajopt",)),
    "failure": ("02_shelf", ("quintic",)),
    "comparison": ("02_shelf", ("trajopt", "rrtconnect", "kpiece", "prm", "quintic", "circle")),
    "srra": ("15_srra", (None,)),
    "delbot": ("27_circle", (None,)),
    "lecture": ("20_puma_quintic", (None,)),
    "baxter": ("30_screw_report_a", (None,)),
}
"""Problem and planners of each page; None: the problem's own."""
BUDGET = 5.0  # s for each planner


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add `live/NAME.html`, which the how-to about the browser shows in frames."""
    for name, text in live_pages().items():
        files.append(File.generated(config, f"live/{name}.html", content=text))
    return files


@cache
def live_pages() -> Mapping[str, str]:
    """The text of each page."""
    found = {}
    for page, (name, planners) in PAGES.items():
        runs = [_viewed(name, planner) for planner in planners]
        found[page] = render_page(build_scene(op.load_problem(name), runs))
    return found


@cache
def _viewed(name: str, planner: str | None) -> ViewedRun:
    problem = op.load_problem(name)
    label = planner or problem.planner
    try:
        run = op.plan(problem, planner, budget=BUDGET)
    except op.InputError as error:
        return ViewedRun(label, None, None, {"kind": "input", "detail": str(error)})
    return ViewedRun.of(run, label)
