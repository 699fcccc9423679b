"""Several planners on one problem: run in turn, saved in their own folders, shown in one table."""

import os
import signal
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from threading import Event
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from optiplan.api.checking import choose, placed
from optiplan.cli.options import listed
from optiplan.cli.output import Exit, handling, messages, results, saved, show_result, stdout_is_ours, tell_interrupted
from optiplan.cli.progress import ProgressLine
from optiplan.errors import InputError, Issue
from optiplan.planners.base import Budget, Failure
from optiplan.planners.registry import PLANNERS, planner_entry
from optiplan.problem.problem import Problem
from optiplan.robot.limits import joint_units
from optiplan.robot.robot import Robot
from optiplan.runs.common_bound import Bound, common_bound
from optiplan.runs.pipeline import plan_and_verify_once
from optiplan.runs.run import Run
from optiplan.runs.run_folder import save_run

ALL = "all"
WIDTH = 170
"""Characters of a line that has everything, reasons included; so many there are where no terminal folds it."""
NARROW = 116
"""Characters of a line without the reasons."""


def several(requested: str | None) -> tuple[str, ...]:
    """Return the planners of `--planner` to compare: `all`, or names separated by commas; () for a single one.

    Raises:
        OptiPlanError: no such planner.
    """
    if requested is None or (requested != ALL and "," not in requested):
        return ()
    return tuple(planner_entry(name).name for name in (PLANNERS if requested == ALL else listed(requested)))


def run_all(
    path: Path, problem: Problem, names: Sequence[str], seconds: float, out: Path | None
) -> tuple[list[Run], list[InputError], bool]:
    """Run each planner with the same budget, best first; the file's planner takes the file's options.

    Each run is saved in `out / name` when finished, and reported on stderr. Ctrl-C ends the planner at work, whose run
    is kept where it is verified, and leaves out the others; pressed again, it ends the process. Also returned: why some
    runs are not saved, and whether Ctrl-C was pressed.

    Raises:
        InputError: invalid planner options in the file.
    """
    if problem.planner in names:
        choose(path, problem, None)
    words = f"{len(names)} planners, each with {seconds:g} s to plan: up to {len(names) * seconds:g} s"
    messages().print(f"{words}, and what it takes to verify", style="dim")
    done: list[Run] = []
    unsaved: list[InputError] = []
    cancel = Event()

    def stop(number: int, _: object) -> None:
        cancel.set()
        signal.signal(number, signal.SIG_DFL)

    with handling((signal.SIGINT,), stop):
        for k, name in enumerate(names, 1):
            options = problem.options if name == problem.planner else {}
            run = _place(path, _one(problem, name, options, Budget(seconds, cancel)))
            if not cancel.is_set() or run.verified:
                if out is not None:
                    saved(partial(save_run, run, out / name), unsaved)
                messages().print(f"{k}/{len(names)} {name}: {_outcome(run)}", markup=False, soft_wrap=True)
                done.append(run)
            if cancel.is_set():
                messages().print(f"interrupted: {len(done)} of {len(names)} planners are done", style="yellow")
                break
    return sorted(done, key=_rank), unsaved, cancel.is_set()


def _one(problem: Problem, name: str, options: Mapping[str, Any], budget: Budget) -> Run:
    with stdout_is_ours(), ProgressLine() as line:
        return plan_and_verify_once(problem, name, options, budget, lambda stage, done: line(f"{name}: {stage}", done))


def _place(path: Path, run: Run) -> Run:
    """Add the lines of the file to issues with the options of its planner."""
    failure = run.failure
    if failure is None or failure.kind != "input" or run.planner != run.problem.planner:
        return run
    error = placed(path, InputError(Issue(**issue) for issue in failure.witness["issues"]))
    witness = {"issues": [vars(issue) for issue in error.issues]}
    return replace(run, failure=Failure(failure.kind, str(error), witness)) if error.issues else run


def _rank(run: Run) -> tuple[bool, bool, float]:
    """Sort verified runs first, then refused ones, both by duration; then those without a motion."""
    return not run.verified, run.trajectory is None, run.duration or 0.0


def bound_of(runs: Sequence[Run]) -> Bound:
    """Return the lower bound of the problem of these runs."""
    return common_bound(runs[0].problem, [run.trajectory.end for run in runs if run.verified and run.trajectory])


def exit_code(runs: Sequence[Run]) -> Exit:
    """Return the exit code of the best run, unless a planner has a bug."""
    if any(run.failure is not None and run.failure.kind == "bug" for run in runs):
        return Exit.BUG
    if any(run.verified for run in runs):
        return Exit.VERIFIED
    return Exit.NOT_VERIFIED if any(run.trajectory is not None for run in runs) else Exit.NO_PLAN


def show(runs: Sequence[Run], as_json: bool, unsaved: Sequence[InputError] = (), interrupted: bool = False) -> int:
    """Print the comparison on stdout, as a table or as one JSON object; return its exit code."""
    if not runs:
        return tell_interrupted("no planner was done", as_json)
    bound = bound_of(runs)
    rows = [{**run.to_dict(), "ratio": bound.ratio(run.duration)} for run in runs]
    data = {"runs": rows, "bound": {"seconds": bound.seconds, "of": bound.words}}
    code = Exit.INTERRUPTED if interrupted else exit_code(runs)
    return show_result(data, lambda: _show(runs, bound), code, as_json, unsaved)


def _show(runs: Sequence[Run], bound: Bound) -> None:
    problem = runs[0].problem
    console = results()
    console.print(f"{problem.name} · {problem.robot.name} · seed {problem.seed}", style="bold", markup=False)
    width = console.width if console.is_terminal or "COLUMNS" in os.environ else max(console.width, WIDTH)
    _print(Console(width=width, highlight=False), runs, bound)


TIMES = ("", "planning\ns", "duration\ns", "duration\n/ bound")


def _measures(robot: Robot) -> tuple[str, ...]:
    """Return the headings of the measures, with the units of the robot's joints."""
    jerk, torque = (joint_units(quantity, robot.revolute).replace(" or ", " or\n") for quantity in ("jerk", "torque"))
    limited = f"peak jerk\n{jerk}", "of its\nlimit", f"RMS torque\n{torque}"
    return "tool path\nm", *limited, "clearance mm\nscene / self", "least mani-\npulability"


def _print(console: Console, runs: Sequence[Run], bound: Bound) -> None:
    """Print the table as the width allows: reasons in a column or below it, or measures in a second half as well."""
    measures = _measures(runs[0].problem.robot)
    if console.width >= WIDTH:
        console.print(_table(runs, bound, (*TIMES, *measures), reasons=True))
    else:
        for headings in ((*TIMES, *measures),) if console.width >= NARROW else (TIMES, measures):
            console.print(_table(runs, bound, headings))
        for run in runs:
            if run.why_not:
                console.print(f"{run.planner}: {run.why_not}", markup=False)
    seconds = "" if bound.seconds is None else f"{bound.seconds:.3f} s, "
    console.print(f"bound: {seconds}{bound.words}", style="dim", markup=False)


def _table(runs: Sequence[Run], bound: Bound, headings: Sequence[str], reasons: bool = False) -> Table:
    table = Table(box=None, pad_edge=False, header_style="dim", padding=(0, 2 if reasons else 1, 0, 0))
    table.add_column("planner", no_wrap=True)
    for heading in headings:
        table.add_column(heading, justify="right" if heading else "left", no_wrap=True)
    if reasons:
        table.add_column("reason", overflow="fold", min_width=24)
    for run in runs:
        word = "no plan" if run.trajectory is None else "not verified"
        verdict = "[green]verified[/]" if run.verified else f"[red]{word}[/]"
        cells = dict(
            zip(
                (*TIMES, *_measures(run.problem.robot)),
                (verdict, *_numbers(run, bound.ratio(run.duration))),
                strict=True,
            )
        )
        why = [escape(run.why_not)] if reasons else []
        table.add_row(escape(run.planner), *(cells[heading] for heading in headings), *why)
    return table


def _numbers(run: Run, ratio: float | None) -> list[str]:
    found = run.metrics
    row = [f"{run.timings['plan']:.2f}", _text(run.duration, ".3f"), _text(ratio, ".3f")]
    if found is None:
        return [*row, *("–" for _ in range(6))]
    return [
        *row,
        _text(found.tool_path, ".3f"),
        _text(found.peak_jerk, ".4g"),
        _text(found.jerk_share, ".0%"),
        _text(found.rms_torque, ".2f"),
        " / ".join(
            _text(None if one is None else 1e3 * one, ".3g") for one in (found.scene_clearance, found.self_clearance)
        ),
        _text(found.manipulability, ".3g"),
    ]


def _text(value: float | None, form: str) -> str:
    return "–" if value is None else "∞" if value == float("inf") else f"{value:{form}}"


def _outcome(run: Run) -> str:
    """Describe a run in a few words."""
    took = f"planned in {run.timings['plan']:.2f} s"
    if run.trajectory is None:
        return f"no plan ({took}): {run.why_not}"
    verdict = "verified" if run.verified else "not verified"
    return f"{verdict}, a motion of {run.duration:.3f} s ({took})"
