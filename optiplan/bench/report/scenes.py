"""Viewer pages beside a report, for links that work without a server: problems compared, and a failure a reason."""

import hashlib
from collections.abc import Iterable, Sequence
from pathlib import Path

from optiplan.bench.report.failures import Failed, Reason
from optiplan.bench.report.show import stored_view, stored_views
from optiplan.bench.results.database import Store
from optiplan.bench.results.records import Key
from optiplan.errors import OptiPlanError
from optiplan.planners.base import Progress
from optiplan.viewer.page import export_page

FOLDER = "report-scenes"
MOST = 10
"""Scenes of failures that are written: of the most frequent reasons. Each is a page of a megabyte or more."""
PAGES = 6
"""Problems with a page of all their planners, unless asked for more or fewer."""


def write_scenes(store: Store, found: Iterable[Reason], page: Path) -> dict[Failed, str]:
    """Write the scenes of failures; addresses relative to the page, by run. A run that cannot be loaded has none."""
    addresses: dict[Failed, str] = {}
    for reason in list(found)[:MOST]:
        run = next((one for one in reason.examples if one.seen), reason.examples[0])
        name = _name(run[:4])
        try:
            problem, view = stored_view(store, (run.problem, run.planner, run.seed, run.repetition))
            export_page(problem, [view], page.parent / FOLDER / name, back=_back(page, "failures"))
        except (OptiPlanError, OSError):
            continue
        addresses[run] = f"{FOLDER}/{name}"
    return addresses


def write_comparisons(
    store: Store, runs: Sequence[tuple[str, Sequence[Key]]], page: Path, progress: Progress
) -> dict[str, str]:
    """Write a page for each problem with the runs that stand for its planners; addresses relative to the report."""
    addresses: dict[str, str] = {}
    for k, (problem_id, keys) in enumerate(runs):
        progress(f"page of {problem_id}", k / len(runs))
        name = _name(("compared", problem_id))
        try:
            problem, views = stored_views(store, keys)
            export_page(problem, views, page.parent / FOLDER / name, back=_back(page, "matrix"))
        except (OptiPlanError, OSError):
            continue
        addresses[problem_id] = f"{FOLDER}/{name}"
    return addresses


def _name(key: object) -> str:
    return f"{hashlib.sha256(repr(key).encode()).hexdigest()[:16]}.html"


def _back(page: Path, section: str) -> tuple[str, str]:
    return f"../{page.name}#{section}", "report"
