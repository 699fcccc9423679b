"""`bench`: every run of a suite, and what came of them."""

import json
from collections.abc import Callable, Mapping
from functools import cached_property
from pathlib import Path
from typing import Any

from optiplan.bench.execution.pool import LocalPool, Workforce
from optiplan.bench.execution.runner import Summary, found_runs, open_results, run_suite
from optiplan.bench.results.best_known import BestKnownTable, Standing, hold_against
from optiplan.bench.results.database import JSON_COLUMNS, Store
from optiplan.bench.results.export import FLAGS
from optiplan.bench.results.records import Outcome
from optiplan.bench.results.summary import failure_counts, planner_numbers, planner_table
from optiplan.bench.suite.suite import load_suite
from optiplan.cores import cores
from optiplan.errors import (
    described,
    flag_argument,
    path_argument,
    progress_argument,
    whole_argument,
    words_of_call,
    wrong_argument,
)
from optiplan.planners.base import Progress
from optiplan.records import dataclass


@dataclass(frozen=True, eq=False, repr=False)
class BenchResults:
    """What came of a suite; its text is a table with one row for each planner.

    Attributes:
        name: of the suite.
        folder: of the results; `optiplan bench report`, `compare` and `export` read it.
        total: runs of the suite.
        found: of these, how many the folder had before.
        made: of these, how many the call made.
        planners: by label: `runs`, the shares `planned`, `timed` and `verified`, and medians over verified runs:
            `plan_time` and `plan_cpu`, s, `ratio` of duration to bound, with `best_known` also `over_best_known`.
        failures: how many runs failed, by kind of failure.
        report: the page with all tables and figures.
    """

    name: str
    folder: Path
    total: int
    found: int
    made: int
    planners: Mapping[str, Mapping[str, Any]]
    failures: Mapping[str, int]
    report: Path

    @cached_property
    def rows(self) -> list[dict[str, Any]]:
        """One mapping for each stored run: the columns of the table `runs`, with `problem_bound`, s, and `ratio`."""
        with Store(self.folder) as store:
            found = store.query("SELECT * FROM rated ORDER BY problem, planner, seed, repetition")
            return [{key: _value(key, row[key]) for key in row.keys()} for row in found]

    def __repr__(self) -> str:
        """The table of planners, the failures, and where the results are."""
        table = planner_table({name: dict(numbers) for name, numbers in self.planners.items()})
        widths = [max(map(len, column)) for column in zip(*table, strict=True)]
        lines = ["  ".join([row[0].ljust(widths[0]), *map(str.rjust, row[1:], widths[1:])]).rstrip() for row in table]
        failed = [f"{count} × {kind}" for kind, count in self.failures.items()]
        return "\n".join([f"{self.name}: {self.total} runs in {self.folder}", *lines, *failed])


def bench(  # noqa: PLR0913  # one keyword for each option of the command
    suite: Path | str,
    out: Path | str | None = None,
    *,
    workers: int | None = None,
    dask: str | None = None,
    pin: bool = False,
    add: bool = False,
    best_known: Path | str | None = None,
    progress: Progress | None = None,
) -> BenchResults:
    """Make every run of a suite that its folder does not hold yet: what `optiplan bench SUITE` does.

    The same call again continues where the last one ended. Each run is made in a process of its own, under the limits
    of the suite. Ctrl-C ends the call; finished runs stay stored.

    Args:
        suite: the path of a suite file.
        out: folder of the results; None: `runs/bench/NAME`.
        workers: runs at a time; None: as many as this process may use cores.
        dask: address of a Dask scheduler, `tcp://…`, whose workers make the runs instead.
        pin: keep each worker on a core of its own.
        add: the folder may hold results of another suite, to which these runs are added.
        best_known: CSV file of the shortest known motions, with which every verified run is compared; shorter ones are
            written into it.
        progress: called, in this thread, with the name of a problem whenever a run of it is stored, and the fraction
            (0 to 1) of the suite's runs that are stored.

    Returns:
        The results: a table as text, `planners`, `failures`, `rows`; the page `report` is written.

    Raises:
        InputError: an argument that does not fit, a fault in the suite file, or results of another suite in the folder.
        OptiPlanError: results cannot be written, no worker can be started, or code was changed meanwhile.

    Example:
        >>> import optiplan as op
        >>> results = op.bench("benchmarks/suites/quick.yaml", workers=2)  # doctest: +SKIP
        >>> print(results)  # doctest: +SKIP
    """
    file = path_argument("bench", "suite", suite, "the path of a suite file")
    given = None if out is None else path_argument("bench", "out", out, "the path of a folder")
    known = None if best_known is None else path_argument("bench", "best_known", best_known, "the path of a CSV file")
    for name, flag in (("pin", pin), ("add", add)):
        flag_argument("bench", name, flag)
    progress_argument("bench", progress)
    _check_workers(workers, dask, pin)
    table = None if known is None else BestKnownTable(known)
    chosen = load_suite(file, scratch_folder(file, given))
    folder = given or results_folder(chosen.spec.name)
    with words_of_call("op.bench", {"with --add": "with add=True", "with --out": "as `out`"}):
        store = open_results(chosen, folder, add)
    with store:
        pool, label = workforce(workers, dask, pin)
        done = run_suite(chosen, store, pool, label, _watch(progress, chosen.size, found_runs(chosen, store)))
        standing = None if table is None else held_against(store, table)
        return _results(store, done, standing)


def workforce(workers: int | None, dask: str | None, pin: bool) -> tuple[Workforce, str]:
    """Return what carries out the runs, and its name in the results."""
    if dask is None:
        count = workers or cores()
        return LocalPool(count, pin), f"{count} local" + (", each on a core of its own" if pin else "")
    from optiplan.bench.dask.cluster import DaskCluster

    cluster = DaskCluster(dask)
    return cluster, f"{cluster.slots} dask {dask}"


def held_against(store: Store, table: BestKnownTable) -> Standing:
    """Compare the runs with a table of best known durations, and write what beats it."""
    standing = hold_against(store, table)
    if standing.new or standing.beaten:
        table.write()
    return standing


def results_folder(name: str) -> Path:
    """Return the folder of a suite's results, where none is given."""
    return Path("runs", "bench", name)


def scratch_folder(suite: Path, out: Path | None) -> Path:
    """Return the folder of files generated for problems, such as meshes of scenes."""
    return (out or results_folder(suite.stem)).resolve() / "files"


def _check_workers(workers: Any, dask: Any, pin: bool) -> None:
    """Raise an error where these do not go together."""
    if workers is not None:
        whole_argument("bench", "workers", workers, 1)
    if dask is not None and not isinstance(dask, str):
        raise wrong_argument(
            "bench", "dask", described(dask), "the address of a scheduler, such as 'tcp://10.0.0.1:8786'"
        )
    if dask is not None and (workers is not None or pin):
        given = "workers" if workers is not None else "pin"
        raise wrong_argument("bench", given, f"{given} beside dask", "no such argument: a cluster has its own workers")
    if pin and (workers or 0) > cores():
        raise wrong_argument("bench", "workers", f"{workers} pinned workers", f"at most {cores()}, one for each core")


def _watch(progress: Progress | None, total: int, stored: int) -> Callable[[Outcome], None]:
    """Return what is called with every stored outcome."""

    def watch(outcome: Outcome) -> None:
        nonlocal stored
        stored += 1
        if progress is not None:
            progress(outcome.row.problem, min(stored / total, 1.0))

    return watch


def _results(store: Store, done: Summary, standing: Standing | None) -> BenchResults:
    """Return what the folder holds now, and write its page."""
    from optiplan.bench.report.analysis import analyse
    from optiplan.bench.report.page import write_page

    report = write_page(store, analyse(store))
    counts = done.total, done.found, done.made
    numbers = planner_numbers(store, standing), failure_counts(store)
    return BenchResults(store.meta("name"), store.folder, *counts, *numbers, report)


def _value(column: str, value: Any) -> Any:
    """Return a value of the table `runs` as Python has it."""
    if value is None:
        return None
    if column in FLAGS:
        return bool(value)
    return json.loads(value) if column in JSON_COLUMNS else value
