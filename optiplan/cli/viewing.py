"""Show stored runs in the viewer."""

import signal
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console

from optiplan.cli.output import print_error, results
from optiplan.errors import InputError, Issue
from optiplan.problem.problem import Problem
from optiplan.runs.run_folder import StoredRun, load_run
from optiplan.runs.stored_runs import judged, recorded_problem
from optiplan.trajectory.trajectory import Trajectory
from optiplan.viewer.plots.runs import PlottedRun
from optiplan.viewer.run_data.closed_loop import read_log
from optiplan.viewer.runs import ViewedRun, distinct_labels
from optiplan.viewer.scene import build_scene
from optiplan.viewer.server import FIRST_PORT, serve_runs, serve_until_interrupted

OPENED = "open {} in a browser (ctrl-C ends)"
DRAWS = 'meshcat.Visualizer("{}") draws into it'
EXECUTED = "execution"
"""Key of a `run.json` that `optiplan control` wrote."""


def open_runs(places: Sequence[Path]) -> tuple[Problem, list[ViewedRun]]:
    """Return the problem of the first run, rebuilt from its record, and the data to show of each.

    Runs of other problems have these with them. Trajectories are verified again: a file changed since must not keep
    the old verdict.

    Raises:
        InputError: a run is broken, or of another robot than the first.
    """
    stored = [load_run(place) for place in places]
    alone = [str(run.place) for run in stored if "problem" not in run.record]
    issues = [Issue(place, None, "file", "a trajectory without its problem", "a run folder") for place in alone]
    if issues:
        raise InputError(issues)
    problems: dict[str, Problem] = {}
    for run in stored:
        key = str(run.record.get("hash"))
        if key not in problems:
            problems[key] = recorded_problem(run.record, run.record_file)
    own = [problems[str(run.record.get("hash"))] for run in stored]
    first = own[0].robot
    for run, problem in zip(stored, own, strict=True):
        if (problem.robot.fingerprint, problem.robot.joint_names) != (first.fingerprint, first.joint_names):
            found = f"a run of the robot '{problem.robot.name}' with {problem.robot.n} joints"
            expected = f"one of '{first.name}' with the joints of {places[0]}"
            issues.append(Issue(str(run.place), None, "problem.robot", found, expected))
    if issues:
        raise InputError(issues)
    labels = _labels(stored, len(problems) > 1)
    viewed = [
        shown(_judged(problem, run), run.trajectory, label)._replace(problem=problem)
        for problem, run, label in zip(own, stored, labels, strict=True)
    ]
    return own[0], [
        one._replace(log=read_log(run.place)) if run.record.get(EXECUTED) else one
        for one, run in zip(viewed, stored, strict=True)
    ]


def plotted_runs(places: Sequence[Path]) -> tuple[list[PlottedRun], list[str]]:
    """Return the runs of a figure, of any problems, and what is left out, in words: runs without a motion.

    Trajectories are verified again, as in `open_runs`.

    Raises:
        InputError: a run is broken, or a trajectory without its problem.
    """
    found, left_out = [], []
    stored = [load_run(place) for place in places]
    for run, label in zip(stored, _labels(stored, False), strict=True):
        if "problem" not in run.record:
            raise InputError([Issue(str(run.place), None, "file", "a trajectory without its problem", "a run folder")])
        if run.trajectory is None:
            left_out.append(
                f"{run.place} has no trajectory: {(run.record.get('failure') or {}).get('detail', 'no plan')}"
            )
            continue
        problem = recorded_problem(run.record, run.record_file)
        report = judged(problem, run)
        found.append(PlottedRun(label, problem, run.trajectory, report.verified))
    return found, left_out


def serve_page(
    problem: Problem,
    runs: Sequence[ViewedRun],
    port: int = FIRST_PORT,
    meshcat_port: int | None = None,
    console: Console | None = None,
) -> None:
    """Serve until ctrl-C; with a port for meshcat also what scripts draw, and what they get wrong is told on stderr.

    The address is printed on `console`, by default stdout.
    """
    signal.signal(signal.SIGINT, signal.default_int_handler)
    console = console or results()
    if meshcat_port is None:
        serve_runs(problem, runs, port=port, on_ready=lambda url: console.print(OPENED.format(url)))
        return
    from optiplan.viewer.drawing.page_server import DrawnPageServer

    with DrawnPageServer(build_scene(problem, runs), meshcat_port, print_error, port=port) as server:

        def ready() -> None:
            console.print(OPENED.format(server.url))
            console.print(DRAWS.format(server.meshcat.url))

        serve_until_interrupted(server, ready)


def shown(record: Mapping[str, Any], trajectory: Trajectory | None, label: str = "") -> ViewedRun:
    """Return one run for the viewer, from its `run.json`."""
    label = label or str(record.get("planner", "run"))
    return ViewedRun(label, trajectory, record.get("report"), record.get("failure"), record)


def _judged(problem: Problem, run: StoredRun) -> Mapping[str, Any]:
    if run.trajectory is None or run.record.get(EXECUTED):  # what was executed is looked at, not proved
        return run.record
    return {**run.record, "report": judged(problem, run).to_dict()}


def _labels(runs: Sequence[StoredRun], problems: bool) -> list[str]:
    """Return planners' names, with the folder where that differs; of several problems those of the problems."""
    names = [str(run.record.get("name" if problems else "planner", "run")) for run in runs]
    if len(runs) > 1:
        names = [
            name if run.place.name == name else f"{name} ({run.place.name})"
            for name, run in zip(names, runs, strict=True)
        ]
    return distinct_labels(names, [f"{run.place.resolve().parent.name}/{run.place.name}" for run in runs])
