"""Serve the report on a local port, with links from runs to the viewer."""

import html
from pathlib import Path
from urllib.parse import parse_qs, urlencode, urlsplit

from optiplan.bench.report.analysis import analyse
from optiplan.bench.report.failures import Failed, reasons
from optiplan.bench.report.matrix import matrix_rows
from optiplan.bench.report.page import Links, render
from optiplan.bench.report.show import stored_views
from optiplan.bench.results.database import Store
from optiplan.errors import OptiPlanError
from optiplan.viewer.page import render_page
from optiplan.viewer.scene import build_scene
from optiplan.viewer.server import PageServer

FIRST_PORT = 7200


class ReportServer(PageServer):
    """The report of a folder of results at `/`, as it is now, any of its runs at `/show?…`, problems at `/compare?…`.

    Raises:
        InputError, StoreError: as `Store`.
        OptiPlanError: no port can be had.
    """

    def __init__(self, folder: Path, port: int = FIRST_PORT) -> None:
        self.folder = folder
        with Store(folder) as store, store.of_one_moment():
            analysis = analyse(store)
            rows = matrix_rows(store, analysis)
            self.compared = {row.name: row.keys() for row in rows}
            page = render(store, analysis, reasons(store), rows, Links(address, compare_address))
        super().__init__(page, port=port)

    def answer(self, path: str) -> bytes | None:
        """Return the report, the viewer's page of a run, or a page with the run's error."""
        parts = urlsplit(path)
        if parts.path not in ("/show", "/compare"):
            return super().answer(path)
        given = parse_qs(parts.query)
        try:
            problem_id = given["problem"][0]
            if parts.path == "/compare":
                keys = self.compared[problem_id]
            else:
                keys = [(problem_id, given["planner"][0], int(given["seed"][0]), int(given["repetition"][0]))]
        except (KeyError, ValueError):
            return None
        try:
            with Store(self.folder) as store:
                problem, runs = stored_views(store, keys)
            return render_page(build_scene(problem, runs), back=("/#matrix", "report")).encode("utf-8")
        except (OptiPlanError, OSError) as error:
            head = '<!doctype html><title>OptiPlan</title><link rel="icon" href="data:,">'
            return f"{head}<pre>{html.escape(str(error))}</pre>".encode()


def address(run: Failed) -> str:
    """Return the address under which the server shows a run."""
    names = ("problem", "planner", "seed", "repetition")
    return f"show?{urlencode(dict(zip(names, run.key, strict=True)))}"


def compare_address(problem: str) -> str:
    """Return the address under which the server shows all planners on a problem."""
    return f"compare?{urlencode({'problem': problem})}"
