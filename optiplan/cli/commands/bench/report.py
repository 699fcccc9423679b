"""`optiplan bench report`, `show`, `compare`: results of a suite as a page, a run as a scene, two results compared."""

import signal
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console

from optiplan.cli.options import AsJson, Port, refuse
from optiplan.cli.output import messages, print_json, results, say, stdout_is_ours
from optiplan.cli.progress import ProgressLine

Folder = Annotated[Path, typer.Argument(metavar="DIR", help="the folder of a suite's results")]


def report(
    folders: Annotated[
        list[Path], typer.Argument(metavar="DIR…", help="folders of results; several are shown together")
    ],
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="the page (default: DIR/report.html, of several report.html)")
    ] = None,
    figures: Annotated[Path | None, typer.Option(metavar="DIR", help="also every figure as PNG, SVG and PDF")] = None,
    tables: Annotated[Path | None, typer.Option(metavar="DIR", help="also every table as CSV and LaTeX")] = None,
    markdown: Annotated[Path | None, typer.Option(metavar="FILE", help="also a table for READMEs")] = None,
    pages: Annotated[int, typer.Option(min=0, metavar="N", help="problems of the matrix with a page to open")] = 6,
    serve: Annotated[bool, typer.Option("--serve", help="serve it until ctrl-C, every run a link")] = False,
    as_json: AsJson = False,
) -> int:
    """Report on a suite's results: one HTML page that needs no network and nothing beside it.

    Also while the suite is running. Results of several folders are shown together, if their problems agree; what else
    differs (budget, limits, code, machines) is said, and planners that differ have the folder behind their name.

    [bold]Examples[/]

      optiplan bench report results/quick

      optiplan bench report results/quick --figures figures --tables tables --markdown table.md

      optiplan bench report results/before results/after --out both.html

      optiplan bench report results/quick --serve
    """
    from optiplan.bench.report.analysis import analyse
    from optiplan.bench.report.figures import write_figures
    from optiplan.bench.report.page import FILE, all_tables, write_page
    from optiplan.bench.report.tables.formats import markdown as table
    from optiplan.bench.report.tables.formats import write_tables
    from optiplan.files import write_text

    with _shown(folders) as store:
        with store.of_one_moment(), stdout_is_ours(), ProgressLine() as line:
            analysis = analyse(store)
            path = out or (folders[0] / FILE if len(folders) == 1 else Path(FILE))
            written = [write_page(store, analysis, path, pages, line)]
        if figures is not None:
            written += write_figures(analysis, figures)
        if tables is not None:
            written += write_tables(all_tables(analysis), tables)
        if markdown is not None:
            write_text(markdown, table(analysis))
            written.append(markdown)
        if as_json:
            print_json({"written": [str(path) for path in written]})
        else:
            say("\n".join(map(str, written)))
        if serve:
            _serve(store.folder, messages() if as_json else results())
    return 0


def show(
    folder: Folder,
    problem: Annotated[str, typer.Argument(metavar="PROBLEM", help="the problem's id")],
    planner: Annotated[str, typer.Argument(metavar="PLANNER", help="a planner's label; several with commas, or all")],
    seed: Annotated[int, typer.Argument(metavar="SEED")] = 0,
    repetition: Annotated[int, typer.Argument(metavar="REPETITION")] = 0,
    export: Annotated[Path | None, typer.Option(metavar="PAGE.html", help="write one file, serve nothing")] = None,
    port: Port = None,
) -> int:
    """Open runs of a suite on one problem in the viewer: their motions, or the witness of a failure.

    [bold]Examples[/]

      optiplan bench show results/quick examples/02_shelf quintic 0

      optiplan bench show results/quick examples/02_shelf all
    """
    from optiplan.bench.report.show import keys_of, stored_views
    from optiplan.bench.results.database import Store
    from optiplan.cli.viewing import serve_page
    from optiplan.viewer.page import export_page
    from optiplan.viewer.server import FIRST_PORT

    if export is not None:
        refuse({"--port": port}, "serves the page; beside --export nothing is served")
    with Store(folder) as store, stdout_is_ours():
        found, runs = stored_views(store, keys_of(store, problem, planner, seed, repetition))
    if export is None:
        serve_page(found, runs, FIRST_PORT if port is None else port)
        return 0
    export_page(found, runs, export)
    say(f"written: {export}")
    return 0


def compare(
    before: Annotated[Path, typer.Argument(metavar="A", help="folder of the old results")],
    after: Annotated[Path, typer.Argument(metavar="B", help="folder of the new results")],
    gate: Annotated[bool, typer.Option("--gate", help="exit 1 on a regression, or without common runs")] = False,
    as_json: AsJson = False,
) -> int:
    """Name what became worse and better, and how sure that is; only runs that both have are compared.

    A regression is fewer verified runs, planning times longer by 20 % (by the clock and by the processor), or motions
    longer by 2 % (medians over problems), that chance explains with a probability below 0.05, corrected for the number
    of comparisons.

    [bold]Example[/]

      optiplan bench compare results/main results/branch --gate

    Exit code: 0 compared · 1 with --gate: there is a regression, or no run in common · 2 bad input.
    """
    from optiplan.bench.results.database import Store
    from optiplan.bench.statistics.compare import REGRESSION
    from optiplan.bench.statistics.compare import compare_results as compared
    from optiplan.cli.printing.bench_compare import comparison_data, show_comparison

    with Store(before) as old, Store(after) as new:
        found = compared(old, new)
    failed = gate and (not found.common or bool(found.of(REGRESSION)))
    if as_json:
        print_json({**comparison_data(found), "exit_code": int(failed)})
    else:
        show_comparison(results(), found)
    return int(failed)


@contextmanager
def _shown(folders: list[Path]) -> Iterator[Any]:
    """The results of one folder, or of several together, which live as long as the command."""
    from optiplan.bench.results.database import Store
    from optiplan.bench.results.growth import together

    if len(folders) == 1:
        with Store(folders[0]) as store:
            yield store
        return
    with tempfile.TemporaryDirectory(prefix="optiplan-") as scratch, together(folders, Path(scratch)) as store:
        yield store


def _serve(folder: Path, console: Console) -> None:
    from optiplan.bench.report.server import ReportServer

    signal.signal(signal.SIGINT, signal.default_int_handler)
    with ReportServer(folder) as server:
        console.print(f"open {server.url} in a browser (ctrl-C ends)")
        try:
            server.serve_forever(poll_interval=0.2)
        except KeyboardInterrupt:
            return
