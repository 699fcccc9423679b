"""`optiplan plan`: from a problem file to a verified trajectory."""

import math
import os
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from threading import Event
from typing import Annotated, Any

import typer

from optiplan.cli.completion import planner_names, problem_names
from optiplan.cli.options import AsJson, Full, refuse
from optiplan.cli.output import Exit, interruptible, messages, results, saved, show_result, stdout_is_ours
from optiplan.cli.progress import KeptAnswer
from optiplan.errors import InputError, errors_about
from optiplan.problem.examples import find_problem

BUDGET = 20.0
"""Seconds, when none are given; as `op.plan`."""
PROBLEM = "a problem file, the name of an example (01_reach), or a folder of problem files with --out"
SERVER = "have an `optiplan serve` plan (OPTIPLAN_TOKEN: its token)"
WORKERS = "attempts of trajopt side by side, in threads: the same motion, sooner; of a folder: processes"
SEEDS = "of a folder: plan every file with the seeds 0 to N - 1"
RATE = "of a folder: samples a second"
LEROBOT = "of a folder: also write the verified episodes as LeRobot data sets (v3.0)"
DASK = "of a folder: plan on the workers of this Dask scheduler (tcp://…)"
TRACKING_ERROR = (
    "rad or m that each joint may be off the motion, which is proved for all of that; instead of the file's"
)
BOUND = "then so many seconds to prove how near the motion is to the shortest one"
PLANNER = "instead of the file's; see: planners. all, or NAME,NAME,…: compares these"


def above_zero(expected: str) -> Callable[[float], float]:
    """Return a callback of an option that requires a finite number above 0."""

    def check(value: float) -> float:
        if not 0.0 < value < math.inf:
            raise typer.BadParameter(f"expected {expected}")
        return value

    return check


positive = above_zero("a number of seconds above 0")


def positive_or_none(seconds: float | None) -> float | None:
    """Require a finite number above 0, if there is one."""
    return None if seconds is None else positive(seconds)


def plan(
    file: Annotated[str, typer.Argument(metavar="FILE", help=PROBLEM, autocompletion=problem_names)],
    planner: Annotated[str | None, typer.Option(metavar="NAME", help=PLANNER, autocompletion=planner_names)] = None,
    seed: Annotated[int | None, typer.Option(min=0, metavar="N", help="instead of the file's")] = None,
    budget: Annotated[
        float, typer.Option(callback=positive, metavar="S", help="seconds of wall time for planning and proof")
    ] = BUDGET,
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="write run.json and trajectory.json there")] = None,
    as_json: AsJson = False,
    bound: Annotated[float | None, typer.Option(callback=positive_or_none, metavar="S", help=BOUND)] = None,
    view: Annotated[bool, typer.Option("--view", help="then show it in the browser")] = False,
    full: Full = False,
    workers: Annotated[int | None, typer.Option(min=1, max=64, metavar="N", help=WORKERS)] = None,
    server: Annotated[str, typer.Option(metavar="URL", help=SERVER)] = "",
    tracking_error: Annotated[float | None, typer.Option(min=0.0, max=10.0, metavar="E", help=TRACKING_ERROR)] = None,
    seeds: Annotated[int | None, typer.Option(min=1, metavar="N", help=SEEDS)] = None,
    rate: Annotated[int | None, typer.Option(min=1, metavar="HZ", help=RATE)] = None,
    lerobot: Annotated[bool, typer.Option("--lerobot", help=LEROBOT)] = False,
    dask: Annotated[str, typer.Option(metavar="URL", help=DASK)] = "",
) -> int:
    """Plan a motion, prove it, and print the report.

    [bold]Examples[/]

      optiplan plan 01_reach                             a bundled example

      optiplan plan cell.yaml --out runs/cell --view     keep the run, look at it

      optiplan plan cell.yaml --planner rrtconnect --seed 3 --budget 5 --json

      optiplan plan cell.yaml --bound 20                 how far from the shortest motion, proved

      optiplan plan cell.yaml --tracking-error 0.002     proved for joints that are up to 0.002 rad or m off

      optiplan plan cell.yaml --planner all --out runs   one table; runs/trajopt, runs/rrtconnect, …

      optiplan plan cell.yaml --server http://127.0.0.1:7100   planned there, verified here

      optiplan plan problems/ --out runs/batch --seeds 10 --lerobot   every *.yaml; again, it continues

    Of several planners each has the whole budget, and the planner that the file names has the file's options.

    Once there is a motion, Ctrl-C ends the search, proves the best one and keeps it; pressed again, it ends at once.

    Exit code: 0 verified · 2 bad input · 3 no plan within the budget · 4 found but not verified
    · 130 ended by Ctrl-C, with the motion found so far.
    Of several planners: 0 one is verified · 4 one was found, none verified · 3 none found · 130 Ctrl-C: those done.
    Of a folder: 0 all verified · 2 a file is bad · 4 one is not verified · 3 one has no plan; the others are planned.
    """
    from optiplan.cli.plan_folder import is_folder_of_problems

    asked = {"seeds": seeds, "rate": rate, "lerobot": lerobot or None, "dask": dask or None}
    if is_folder_of_problems(file):
        one = {"--seed": seed, "--view": view or None, "--server": server or None, "--tracking-error": tracking_error}
        one |= {"--bound": bound, "--full": full or None}
        return _folder(Path(file), out, planner, budget, as_json, {**asked, "workers": workers}, one)
    refuse({f"--{flag}": value for flag, value in asked.items()}, "goes with a folder of problems")
    from optiplan.api.planning import with_tracking_error
    from optiplan.cli import plan_comparison
    from optiplan.problem.load import load_problem
    from optiplan.runs.run_folder import check_folder

    path, names, interrupted = find_problem(file), plan_comparison.several(planner), False
    if names:
        _of_several_planners(server, {"--workers": workers, "--bound": bound, "--full": full or None})
    if out is not None:
        for folder in [out / name for name in names] or [out]:
            check_folder(folder)
    with stdout_is_ours():
        began = time.perf_counter()
        problem = load_problem(path) if seed is None else load_problem(path).with_seed(seed)
        problem = problem if tracking_error is None else with_tracking_error(problem, tracking_error)
        loaded = time.perf_counter() - began
        _check_bound(path, problem, bound)
    if names:
        runs, unsaved, interrupted = plan_comparison.run_all(path, problem, names, budget, out)
        code = plan_comparison.show(runs, as_json, unsaved, interrupted)
    else:
        progress, more = KeptAnswer(), {} if workers is None else {"workers": workers}
        run = _run(path, problem, planner, more, budget, server, progress)
        found = _bound(run, bound, progress.cancel)
        runs = [replace(run, timings={"load": loaded, **run.timings}, proved_bound=found)]
        code = _finish(runs[0], out, as_json, full, interrupted=progress.cancel.is_set())
    if view and not interrupted:  # of one planner Ctrl-C ends the search alone
        _view(runs, as_json)
    return code


def _of_several_planners(server: str, one: dict[str, Any]) -> None:
    """Refuse what goes with one planner only; `one` are such flags."""
    if server:
        raise typer.BadParameter("a server runs one planner at a time", param_hint="--planner")
    refuse(one, "goes with one planner at a time")


def _folder(
    folder: Path,
    out: Path | None,
    planner: str | None,
    budget: float,
    as_json: bool,
    asked: dict[str, Any],
    one: dict[str, Any],
) -> int:
    """Plan a folder of problems; `one` are the flags that go with one problem only."""
    from optiplan.api.batches import RATE as SAMPLES
    from optiplan.cli.plan_folder import plan_folder

    refuse(one, "goes with one problem, not with a folder")
    given = {**asked, "rate": asked["rate"] or SAMPLES, "lerobot": bool(asked["lerobot"]), "dask": asked["dask"] or ""}
    return plan_folder(folder, out, planner, budget, as_json, given)


def _run(
    path: Path,
    problem: Any,
    planner: str | None,
    more: dict[str, int],
    seconds: float,
    server: str,
    progress: KeptAnswer,
) -> Any:
    """Run one planner for so many seconds, here or on a server; issues with the options carry the file's lines.

    `more` are options beside those of the file.
    """
    from optiplan.api.checking import choose, placed
    from optiplan.planners.base import Budget
    from optiplan.runs import pipeline

    chosen, options = choose(path, problem, planner)
    options = {**options, **more}
    if server:
        return _run_there(server, path, problem, chosen, options, seconds)
    with stdout_is_ours(), progress:
        try:
            return pipeline.answer(problem, chosen, options, Budget(seconds, progress.cancel), progress)
        except InputError as error:
            raise placed(path, error) if options else error from None


def _check_bound(path: Path, problem: Any, seconds: float | None) -> None:
    """Refuse, before it is planned, a problem without a known bound where one is wanted."""
    if seconds is not None:
        from optiplan.api.bounding import require_bound

        with errors_about("op.bound", str(path)):
            require_bound(problem)


def _bound(run: Any, seconds: float | None, cancel: Event) -> Any:
    """The bound that is proved in so many seconds; None without them, or after Ctrl-C, which sets `cancel`."""
    if seconds is None or cancel.is_set():
        return None
    from optiplan.api.bounding import bound

    try:
        with interruptible(), stdout_is_ours():
            return bound(run.problem, seconds, run if run.verified else None)
    except KeyboardInterrupt:
        cancel.set()
        return None


def _run_there(server: str, path: Path, problem: Any, planner: str, options: Any, seconds: float) -> Any:
    """Have a server plan; the motion is verified here."""
    from optiplan.service.client import Client

    with errors_about("op.Client", "--server"):
        there = Client(server, os.environ.get("OPTIPLAN_TOKEN", "").strip())
    with errors_about("problem.yaml", f"{path} at {server}"), there as client, stdout_is_ours():
        return client.plan(problem, planner, options, budget=seconds)


def _finish(run: Any, out: Path | None, as_json: bool, full: bool, *, interrupted: bool) -> int:
    """Save the run and print it, even where it cannot be saved; return its exit code."""
    from optiplan.cli.printing.report import show_run
    from optiplan.runs.run_folder import save_run

    code = Exit.VERIFIED if run.verified else Exit.NO_PLAN if run.trajectory is None else Exit.NOT_VERIFIED
    code = Exit.INTERRUPTED if interrupted else code
    unsaved: list[InputError] = []
    if out is not None:
        saved(partial(save_run, run, out), unsaved)
    if interrupted:
        messages().print("interrupted: this is the best motion so far", style="yellow")
    return show_result(run.to_dict(), lambda: show_run(results(), run, full), code, as_json, unsaved)


def _view(runs: list[Any], as_json: bool) -> None:
    from optiplan.cli.viewing import serve_page, shown

    viewed = [shown(run.to_dict(), run.trajectory) for run in runs]
    serve_page(runs[0].problem, viewed, console=messages() if as_json else results())
