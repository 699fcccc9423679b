"""Viewer pages beside a report: one failure of every reason, for links that work without a server."""

import hashlib
from collections.abc import Iterable
from pathlib import Path

from optiplan.bench.report.failures import Failed, Reason
from optiplan.bench.report.show import stored_view
from optiplan.bench.results.database import Store
from optiplan.errors import OptiPlanError
from optiplan.viewer.page import export_page

FOLDER = "report-scenes"
MOST = 10
"""Scenes that are written: of the most frequent reasons. Each is a page of a megabyte or more."""


def write_scenes(store: Store, found: Iterable[Reason], page: Path) -> dict[Failed, str]:
    """Write the scenes; addresses relative to the page, by run. A run that cannot be loaded has none."""
    addresses: dict[Failed, str] = {}
    for reason in list(found)[:MOST]:
        run = next((one for one in reason.examples if one.seen), reason.examples[0])
        name = hashlib.sha256(repr(run[:4]).encode()).hexdigest()[:16]
        try:
            problem, view = stored_view(store, (run.problem, run.planner, run.seed, run.repetition))
            export_page(problem, [view], page.parent / FOLDER / f"{name}.html")
        except (OptiPlanError, OSError):
            continue
        addresses[run] = f"{FOLDER}/{name}.html"
    return addresses
