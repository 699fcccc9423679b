"""`optiplan bench`: run or resume a suite of problems and planners, export its results."""

import signal
from pathlib import Path
from typing import Annotated, Any

import typer

from optiplan.cli.commands.bench import report
from optiplan.cli.options import AsJson
from optiplan.cli.output import Exit, handling, messages, print_json, results, say, stdout_is_ours
from optiplan.cli.printing.bench_progress import progress
from optiplan.cli.progress import ProgressLine


class _Group(typer.core.TyperGroup):
    """`optiplan bench SUITE` stands for `optiplan bench run SUITE`."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        if args and args[0] not in self.commands and args[0] not in ("--help", "-h"):
            args = ["run", *args]
        return super().parse_args(ctx, args)


app = typer.Typer(cls=_Group, no_args_is_help=True)


@app.callback()
def bench() -> None:
    """Run suites of problems and planners: optiplan bench SUITE.yaml [--workers N] [--out DIR]."""


@app.command("run")
def run(
    suite: Annotated[Path, typer.Argument(metavar="SUITE", help="a suite file, such as benchmarks/suites/quick.yaml")],
    workers: Annotated[
        int | None, typer.Option(min=1, metavar="N", help="runs at a time (default: the number of cores)")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="where the results go (default: runs/bench/NAME)"),
    ] = None,
    dask: Annotated[
        str | None, typer.Option(metavar="tcp://…", help="address of a Dask scheduler whose workers make the runs")
    ] = None,
    pin: Annotated[bool, typer.Option("--pin", help="keep each worker on a core of its own")] = False,
    add: Annotated[
        bool, typer.Option("--add", help="add planners, problems or seeds to the results of another suite")
    ] = False,
    best_known: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="table of best known durations, updated with shorter ones"),
    ] = None,
    as_json: AsJson = False,
) -> int:
    """Make every run of a suite that the folder does not hold yet.

    The same command again continues where the last one ended.
    With --add the folder may be of another suite: the runs of this one are added to it.
    With --best-known every verified run is compared with a CSV file of the shortest known motions, and shorter ones
    are written into it.

    [bold]Examples[/]

      optiplan bench benchmarks/suites/quick.yaml

      optiplan bench mine.yaml --workers 4 --pin --out results/mine

      optiplan bench more.yaml --add --out results/mine

      optiplan bench mine.yaml --dask tcp://10.0.0.1:8786

    Exit code: 0 every run was made, verified or not · 2 bad input, or results cannot be written · 130 interrupted.
    """
    from optiplan.bench.bench import held_against, results_folder, scratch_folder
    from optiplan.bench.execution.runner import found_runs, open_results, other_versions, run_suite
    from optiplan.bench.results.best_known import BestKnownTable
    from optiplan.bench.suite.suite import load_suite

    table = None if best_known is None else BestKnownTable(best_known)
    pool, label = _workforce(workers, dask, pin)
    with stdout_is_ours(), ProgressLine() as line:
        chosen = load_suite(suite, scratch_folder(suite, out), line)
    folder = out or results_folder(chosen.spec.name)
    with open_results(chosen, folder, add) as store:
        for words in other_versions(store):
            messages().print(
                f"note: earlier runs were made with another version of {words}", style="yellow", markup=False
            )
        # Ctrl-C and SIGTERM end the current runs and let finished ones be stored
        ends = handling((signal.SIGINT, signal.SIGTERM), lambda *_: pool.close())
        with ends, progress(chosen.size, found_runs(chosen, store)) as watch:
            done = run_suite(chosen, store, pool, label, watch)
        standing = None if table is None else held_against(store, table)
        _tell(store, done, standing, as_json)
    if not done.complete:
        left = done.total - done.found - done.made
        messages().print(f"interrupted, {left} of {done.total} runs are left: the same command goes on", style="yellow")
    return 0 if done.complete else Exit.INTERRUPTED


@app.command("export")
def export(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="the folder of a suite's results")],
    to: Annotated[Path | None, typer.Option(metavar="OUT", help="where the files go (default: DIR)")] = None,
    kind: Annotated[
        str, typer.Option("--format", metavar="F", help="csv, parquet, all (both), problems, ompl or robometrics")
    ] = "all",
    as_json: AsJson = False,
) -> int:
    """Write the results for other programs.

    csv and parquet: the tables runs, problems, planners, sessions. problems: files for `optiplan plan`.
    ompl: logs that Planner Arena reads, one a set. robometrics: their metrics, one file a planner.
    Also while the suite is running. Parquet needs the extra `results`.
    """
    from optiplan.bench.results import export as tables
    from optiplan.bench.results.database import Store
    from optiplan.bench.results.ompl_log import write_logs
    from optiplan.errors import UnknownChoiceError

    others = {"problems": tables.write_problems, "ompl": write_logs, "robometrics": tables.write_metrics}
    if kind not in (*tables.FORMATS, "all", *others):
        raise UnknownChoiceError("format", kind, (*tables.FORMATS, "all", *others))
    with Store(folder) as store, store.of_one_moment():
        wanted = tables.FORMATS if kind == "all" else (kind,)
        if kind in others:
            written = others[kind](store, to or folder)
        else:
            written = [path for each in wanted for path in tables.export_results(store, to or folder, each)]
    if as_json:
        print_json({"written": [str(path) for path in written]})
    else:
        say("\n".join(map(str, written)))
    return 0


@app.command("merge")
def merge(
    folders: Annotated[list[Path], typer.Argument(metavar="DIR DIR…", help="folders of results")],
    out: Annotated[Path, typer.Option(metavar="DIR", help="where all of them go, a folder without results")],
    as_json: AsJson = False,
) -> int:
    """Merge folders of results into one, which can be gone on with, added to and reported like any other.

    They may differ in planners, problems, seeds and repetitions. Budget, limits, metrics, code, and the content of
    problems and planners of one name must agree; results that do not are reported together by `bench report A B`.

    [bold]Example[/]

      optiplan bench merge results/monday results/tuesday --out results/both
    """
    from optiplan.bench.results.growth import merge_results as merged

    if len(folders) < 2:
        raise typer.BadParameter("one folder: expected two or more")
    with merged(folders, out) as store:
        counts = {name: store.query(f"SELECT count(*) FROM {name}")[0][0] for name in ("runs", "problems", "planners")}
    if as_json:
        print_json({"results": str(store.path), **counts, "exit_code": 0})
    else:
        words = f"{counts['runs']} runs of {counts['problems']} problems and {counts['planners']} planners in {out}"
        say(words)
    return 0


@app.command("import-results")
def import_results(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="results in JSON, see docs/how-to/benchmarks.md")],
    beside: Annotated[Path, typer.Argument(metavar="DIR", help="our results on the same problems")],
    out: Annotated[Path, typer.Option(metavar="OUT", help="where these results go, a folder of their own")],
    label: Annotated[str, typer.Option(metavar="NAME", help="what to call the planner")] = "external",
) -> int:
    """Read results that were made elsewhere, to compare with ours.

    Entries are matched by their field `problem`. Those with a trajectory (samples t, q) are verified here; the others
    count as planned, with the times that their authors tell, and never as verified.
    """
    from optiplan.bench.results.database import Store
    from optiplan.bench.results.imported import read_results

    with Store(beside) as store, stdout_is_ours():
        found = read_results(file, label, store, out)
    words = f"{found.runs} runs in {out}: {found.trajectories} with a trajectory, {found.verified} of them verified"
    say(words)
    return 0


def _workforce(workers: int | None, dask: str | None, pin: bool) -> tuple[Any, str]:
    """Return the workforce, and its name in the results."""
    from optiplan.bench.bench import workforce
    from optiplan.cores import cores

    if dask is None and pin and (workers or 0) > cores():
        raise typer.BadParameter(
            f"--pin: {workers} workers, and {cores()} cores for them: expected --workers {cores()}"
        )
    if dask is not None and (workers is not None or pin):
        raise typer.BadParameter("--dask brings its own workers: leave out --workers and --pin")
    return workforce(workers, dask, pin)


app.command("report")(report.report)
app.command("show")(report.show)
app.command("compare")(report.compare)


def _tell(store: Any, done: Any, standing: Any, as_json: bool) -> None:
    """Print the end of a suite: one line per planner; write the page once every run is there."""
    from optiplan.bench.report.analysis import analyse
    from optiplan.bench.report.page import write_page
    from optiplan.cli.printing.bench_summary import show_summary, summary_data

    with stdout_is_ours(), ProgressLine() as line:
        page = write_page(store, analyse(store), progress=line) if done.complete else None
    if as_json:
        print_json(summary_data(store, done, standing) | {"report": page and str(page)})
        return
    show_summary(results(), store, done, standing)
    if page:
        say(f"report: {page}")
