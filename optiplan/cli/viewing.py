"""Show stored runs in the viewer."""

import signal
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from optiplan.cli.output import results
from optiplan.errors import InputError, Issue
from optiplan.problem.load import problem_from_dict
from optiplan.problem.problem import Problem
from optiplan.runs.run_folder import StoredRun, load_run
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.verify import verify
from optiplan.viewer.log_curves import read_log
from optiplan.viewer.plots.runs import PlottedRun
from optiplan.viewer.runs import ViewedRun
from optiplan.viewer.server import serve

EXECUTED = "execution"
"""Key of a `run.json` that `optiplan control` wrote."""


def open_runs(places: Sequence[Path]) -> tuple[Problem, list[ViewedRun]]:
    """Return the problem of the runs, rebuilt from the first one's record, and the data to show of each.

    Trajectories are verified again: a file changed since must not keep the old verdict.

    Raises:
        InputError: a run is broken, or was made from another problem than the first.
    """
    stored = [load_run(place) for place in places]
    issues = []
    for run in stored:
        expected = f"a run of '{stored[0].record.get('name')}', as {places[0]}"
        if "problem" not in run.record:
            issues.append(Issue(str(run.place), None, "file", "a trajectory without its problem", "a run folder"))
        elif run.record.get("hash") != stored[0].record.get("hash"):
            issues.append(Issue(str(run.place), None, "hash", f"a run of '{run.record.get('name')}'", expected))
    if issues:
        raise InputError(issues)
    problem = problem_from_dict(stored[0].record["problem"])
    labels = [_label(run, len(stored) > 1) for run in stored]
    viewed = [shown(_judged(problem, run), run.trajectory, label) for run, label in zip(stored, labels, strict=True)]
    return problem, [
        one._replace(log=read_log(run.place)) if EXECUTED in run.record else one
        for one, run in zip(viewed, stored, strict=True)
    ]


def plotted_runs(places: Sequence[Path]) -> tuple[list[PlottedRun], list[str]]:
    """Return the runs of a figure, of any problems, and what is left out, in words: runs without a motion.

    Trajectories are verified again, as in `open_runs`.

    Raises:
        InputError: a run is broken, or a trajectory without its problem.
    """
    found, left_out = [], []
    for place in places:
        run = load_run(place)
        if "problem" not in run.record:
            raise InputError([Issue(str(place), None, "file", "a trajectory without its problem", "a run folder")])
        if run.trajectory is None:
            left_out.append(f"{place} has no trajectory: {(run.record.get('failure') or {}).get('detail', 'no plan')}")
            continue
        problem = problem_from_dict(run.record["problem"])
        report = verify(problem, run.trajectory, given=run.samples)
        found.append(PlottedRun(_label(run, len(places) > 1), problem, run.trajectory, report.verified))
    return found, left_out


def serve_page(problem: Problem, runs: Sequence[ViewedRun], port: int) -> None:
    """Serve until ctrl-C."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    console = results()
    serve(problem, runs, port=port, on_ready=lambda url: console.print(f"open {url} in a browser (ctrl-C ends)"))


def shown(record: Mapping[str, Any], trajectory: Trajectory | None, label: str = "") -> ViewedRun:
    """Return one run for the viewer, from its `run.json`."""
    label = label or str(record.get("planner", "run"))
    return ViewedRun(label, trajectory, record.get("report"), record.get("failure"), record)


def _judged(problem: Problem, run: StoredRun) -> Mapping[str, Any]:
    if run.trajectory is None or EXECUTED in run.record:  # what was executed is looked at, not proved
        return run.record
    return {**run.record, "report": verify(problem, run.trajectory, given=run.samples).to_dict()}


def _label(run: StoredRun, several: bool) -> str:
    """Return the planner's name, with the folder where that differs."""
    planner = run.record.get("planner", "run")
    return f"{planner} ({run.place.name})" if several and run.place.name != planner else str(planner)
