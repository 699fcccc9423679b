"""`optiplan plan`: from a problem file to a verified trajectory."""

import math
import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

from optiplan.cli.files import find_problem
from optiplan.cli.output import Exit, interrupts_held, print_json, results, stdout_is_ours
from optiplan.cli.planner_choice import planner_issues
from optiplan.cli.progress import ProgressLine
from optiplan.errors import InputError

BUDGET = 20.0
"""Seconds, when none are given."""
PORT = 7000
"""First port that --view tries."""


def _positive(seconds: float) -> float:
    if not 0.0 < seconds < math.inf:
        raise typer.BadParameter("expected a number of seconds above 0")
    return seconds


def plan(
    file: Annotated[str, typer.Argument(metavar="FILE", help="a problem file, or the name of an example: 01_reach")],
    planner: Annotated[str | None, typer.Option(metavar="NAME", help="instead of the file's; see: planners")] = None,
    seed: Annotated[int | None, typer.Option(min=0, metavar="N", help="instead of the file's")] = None,
    budget: Annotated[
        float, typer.Option(callback=_positive, metavar="S", help="seconds of wall time for the planner")
    ] = BUDGET,
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="write run.json and trajectory.json there")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="print one JSON object and nothing else")] = False,
    view: Annotated[bool, typer.Option("--view", help="then show it in the browser")] = False,
) -> int:
    """Plan a motion, prove it, and print the report.

    [bold]Examples[/]

      optiplan plan 01_reach                             an example that comes along

      optiplan plan cell.yaml --out runs/cell --view     keep the run, look at it

      optiplan plan cell.yaml --planner rrtconnect --seed 3 --budget 5 --json

    Exit code: 0 verified · 2 bad input · 3 no plan within the budget · 4 found but not verified.
    """
    from optiplan import pipeline
    from optiplan.cli.report import show_run
    from optiplan.planners.base import Budget
    from optiplan.problem.load import load_problem
    from optiplan.store import check_folder, save_run
    from optiplan.verify.report import jsonable

    path = find_problem(file)
    if out is not None:
        check_folder(out)
    with stdout_is_ours(), ProgressLine() as progress:
        began = time.perf_counter()
        problem = load_problem(path) if seed is None else replace(load_problem(path), seed=seed)
        loaded = time.perf_counter() - began
        chosen, options = _choice(path, problem, planner)
        run = pipeline.run(problem, chosen, options, Budget(budget), progress)
    run = replace(run, timings={"load": loaded, **run.timings})
    code = Exit.VERIFIED if run.verified else Exit.NO_PLAN if run.trajectory is None else Exit.NOT_VERIFIED
    if out is not None:
        with interrupts_held():
            save_run(run, out)
    if as_json:
        print_json(jsonable({**run.to_dict(), "exit_code": int(code)}))
    else:
        show_run(results(), run)
    if view:
        _view(run)
    return code


def _choice(path: Path, problem: Any, planner: str | None) -> tuple[str, Mapping[str, Any]]:
    """The planner's name and options: the file's, unless another one is asked for."""
    if planner is not None and planner != problem.planner:
        return planner, {}
    issues = planner_issues(path)
    if issues:
        raise InputError(issues)
    return problem.planner, problem.options


def _view(run: Any) -> None:
    from optiplan.cli.viewing import serve_page, shown

    serve_page(run.problem, [shown(run.to_dict(), run.trajectory)], PORT)
