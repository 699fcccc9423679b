"""`optiplan view`: runs in the browser, or as a page to send."""

from pathlib import Path
from typing import Annotated

import typer

from optiplan.cli.output import results
from optiplan.errors import InputError, Issue


def view(
    runs: Annotated[list[Path], typer.Argument(metavar="RUN…", help="run folders of one problem")],
    export: Annotated[Path | None, typer.Option(metavar="PAGE.html", help="write one file, serve nothing")] = None,
    port: Annotated[int, typer.Option(min=0, max=65535, metavar="N", help="first port to try; 0: any")] = 7000,
) -> int:
    """Show runs in the browser: play, pause, scrub, slow down; several runs of one problem play side by side.

    An exported page needs no network and no OptiPlan; `#t=0.6&paused` behind its address shows one instant.

    [bold]Examples[/]

      optiplan view runs/shelf

      optiplan view runs/trajopt runs/rrtconnect --export compare.html
    """
    from optiplan.cli.viewing import open_runs, serve_page
    from optiplan.viewer.page import export_page

    if export is not None and export.is_dir():
        raise InputError([Issue(str(export), None, "export", "is a folder", "a file to write, such as page.html")])
    problem, shown = open_runs(runs)
    if export is None:
        serve_page(problem, shown, port)
        return 0
    export_page(problem, shown, export)
    results().print(f"written: {export}", markup=False, soft_wrap=True)
    return 0
