"""The matrix of a report: problems by planners, a picture of every motion, links to look at it and to compare."""

import html
import json
from collections.abc import Callable, Mapping, Sequence
from typing import Any
from urllib.parse import quote

import numpy as np

from optiplan.arrays import Array
from optiplan.bench.execution.robot_cache import RobotCache
from optiplan.bench.report.analysis import Analysis
from optiplan.bench.report.tables.cells import number
from optiplan.bench.results.database import Store
from optiplan.bench.results.growth import place_of
from optiplan.bench.results.records import Key
from optiplan.errors import OptiPlanError
from optiplan.figure_style import COLOURS
from optiplan.kinematics.manipulability import ToolKinematics
from optiplan.planners.base import Progress, silent
from optiplan.problem.load import problem_from_dict
from optiplan.problem.problem import Problem
from optiplan.records import dataclass
from optiplan.trajectory.trajectory import Trajectory
from optiplan.viewer.thumbnail import HEIGHT, WIDTH, Thumbnail, drawn_path, thumbnail

MOST_PROBLEMS = 40
"""Rows: each has a picture, and each cell a path."""
POINTS = 36
"""Of a path."""

SELECT = """
SELECT planner, seed, repetition, verified, plan_time, duration, ratio, trajectory, failure_kind, failure_detail,
    json_extract(metrics, '$.clearance') AS clearance
FROM rated WHERE problem = ? ORDER BY seed, repetition
"""


@dataclass(frozen=True, eq=False)
class ProblemRow:
    """One problem of the matrix.

    Attributes:
        name: id of the problem.
        picture: of its scene; None where it cannot be loaded.
        shown: by planner the run that stands for all: the first that is verified, else that has a motion, else any.
        verified: by planner how many of its runs are verified, and how many there are.
        paths: by planner the path of that run's tool in the picture, (POINTS, 2), px.
    """

    name: str
    picture: Thumbnail | None
    shown: Mapping[str, Mapping[str, Any]]
    verified: Mapping[str, tuple[int, int]]
    paths: Mapping[str, Array]

    def keys(self) -> list[Key]:
        """Keys of the runs that stand for their planners."""
        return [(self.name, label, row["seed"], row["repetition"]) for label, row in self.shown.items()]


Address = Callable[[str], str | None]
"""Where the runs of a problem can be looked at together; None where only a command shows them."""


def matrix_rows(store: Store, analysis: Analysis, progress: Progress = silent) -> list[ProblemRow]:
    """Rows of the problems of `chosen_problems`."""
    robots = RobotCache()
    names = chosen_problems(analysis)
    rows = []
    for k, name in enumerate(names):
        progress(f"picture of {name}", k / len(names))
        rows.append(_row(store, name, analysis.runs.planners, robots))
    return rows


def chosen_problems(analysis: Analysis) -> list[str]:
    """All problems, or of many those on which planners differ most: in success, then in duration; in suite order."""
    runs = analysis.runs
    tried = [k for k in range(len(runs.problems)) if (runs.problem == k).any()] if runs.size else []
    if len(tried) <= MOST_PROBLEMS:
        return [runs.problems[k] for k in tried]
    shape = (len(runs.problems), len(runs.planners))
    share, count = np.zeros(shape), np.zeros(shape)
    np.add.at(count, (runs.problem, runs.planner), 1.0)
    np.add.at(share, (runs.problem, runs.planner), runs.verified)
    share = np.where(count > 0.0, share / np.maximum(count, 1.0), np.nan)
    some = (count > 0.0).any(axis=1, keepdims=True)
    spread = np.nanstd(np.where(some, share, 0.0), axis=1)
    longest, shortest = (np.full(len(runs.problems), end) for end in (-np.inf, np.inf))
    known = runs.verified & (runs.duration > 0.0)
    np.maximum.at(longest, runs.problem[known], np.log(runs.duration[known]))
    np.minimum.at(shortest, runs.problem[known], np.log(runs.duration[known]))
    order = np.lexsort((np.arange(len(spread)), shortest - longest, -np.round(spread, 6)))
    kept = sorted(int(k) for k in order[:MOST_PROBLEMS])
    return [runs.problems[k] for k in kept]


def matrix_html(store: Store, analysis: Analysis, rows: Sequence[ProblemRow], address: Address) -> str:
    """The matrix as HTML: pictures once, a row a problem, a column a planner."""
    planners, sets = analysis.runs.planners, dict(zip(analysis.runs.problems, analysis.runs.sets, strict=True))
    pictures = "".join(
        f'<symbol id="scene-{k}" viewBox="0 0 {WIDTH} {HEIGHT}"><image width="{WIDTH}" height="{HEIGHT}" '
        f'href="{row.picture.address}"/></symbol>'
        for k, row in enumerate(rows)
        if row.picture is not None
    )
    heads = "".join(
        f'<th scope=col data-column={k}><span class=planner data-planner="{k}">{html.escape(label)}</span></th>'
        for k, label in enumerate(planners)
    )
    body = "".join(_row_html(store, k, row, planners, sets[row.name], address(row.name)) for k, row in enumerate(rows))
    return (
        f'<svg class=hidden width=0 height=0 aria-hidden="true">{pictures}</svg>'
        f'<div class=scroll tabindex=0 role=region aria-label="Problems by planners"><table class=matrix>'
        f"<thead><tr><th scope=col>problem</th>{heads}</tr></thead><tbody>{body}</tbody></table></div>"
    )


def path_of(problem: Problem, trajectory: Trajectory, picture: Thumbnail) -> Array:
    """Path of the tool in a picture, (POINTS, 2), px."""
    times = np.linspace(0.0, trajectory.duration, POINTS)
    return picture.project(ToolKinematics(problem.robot).evaluate(trajectory(times))[0][:, :3, 3])


def _row(store: Store, name: str, planners: Sequence[str], robots: RobotCache) -> ProblemRow:
    shown: dict[str, Mapping[str, Any]] = {}
    counts: dict[str, tuple[int, int]] = {}
    for found in store.query(SELECT, (name,)):
        row = dict(found)
        label = row["planner"]
        good, tried = counts.get(label, (0, 0))
        counts[label] = good + bool(row["verified"]), tried + 1
        if label not in shown or _rank(row) > _rank(shown[label]):
            shown[label] = row
    shown = {label: shown[label] for label in planners if label in shown}
    try:
        problem = problem_from_dict(store.problem(name).data, "/", robots)
        picture = thumbnail(problem)
    except (OptiPlanError, OSError):
        return ProblemRow(name, None, shown, counts, {})
    paths = {}
    for label, one in shown.items():
        motion = None if one["trajectory"] is None else store.trajectory(one["trajectory"])
        if motion is not None and motion.joint_names == problem.robot.joint_names:
            paths[label] = path_of(problem, motion, picture)
    return ProblemRow(name, picture, shown, counts, paths)


def _rank(row: Mapping[str, Any]) -> int:
    return 2 * bool(row["verified"]) + (row["trajectory"] is not None)


def _row_html(
    store: Store, k: int, row: ProblemRow, planners: Sequence[str], set_name: str, address: str | None
) -> str:
    picture = _picture(k, row, "")
    name = html.escape(row.name)
    broken = name.replace("/", "/<wbr>")
    linked = (
        f'<a href="{html.escape(address)}">{picture}<b>{broken}</b></a>' if address else f"{picture}<b>{broken}</b>"
    )
    cells = "".join(_cell_html(store, k, row, j, label, address) for j, label in enumerate(planners))
    page = f' data-page="{html.escape(address)}"' if address else ""
    return f'<tr data-set="{html.escape(set_name)}" data-problem="{name}"{page}><th scope=row>{linked}</th>{cells}</tr>'


def _cell_html(store: Store, k: int, row: ProblemRow, j: int, label: str, address: str | None) -> str:
    if label not in row.shown:
        return f"<td data-column={j} class=none>–</td>"
    run, (good, tried) = row.shown[label], row.verified[label]
    kind = "good" if good == tried else "mixed" if good else "bad"
    picture = _picture(k, row, drawn_path(row.paths[label], 3.2) if label in row.paths else "")
    words = _words(run, good, tried)
    told = html.escape("\n".join([f"{label} on {row.name}", *_told(run, good, tried)]))
    inside = f"{picture}<span class=said>{words}</span>"
    name = html.escape(label)
    if address:
        opened = f'<a class=open data-tip="{told}" href="{html.escape(address)}#runs={quote(label)}">{inside}</a>'
    else:
        opened = f'<span class=open tabindex=0 data-tip="{told}">{inside}</span>'
    folder, key = place_of(store, (row.name, label, run["seed"], run["repetition"]))
    actual = html.escape(json.dumps([folder, *key[1:]]))
    pick = (
        f'<input type=checkbox class=pick aria-label="compare {name} on {html.escape(row.name)}" '
        f'data-run="{name}" data-actual="{actual}">'
    )
    return f'<td data-column={j} class="cell {kind}" style="--path: var(--c{j % len(COLOURS)})">{pick}{opened}</td>'


def _picture(k: int, row: ProblemRow, drawn: str) -> str:
    """The scene of a row, with something drawn on it; nothing where it cannot be loaded."""
    if row.picture is None:
        return ""
    return f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" aria-hidden="true"><use href="#scene-{k}"/>{drawn}</svg>'


def _words(run: Mapping[str, Any], good: int, tried: int) -> str:
    share = "" if tried == 1 else f" <small>{good}/{tried}</small>"
    if not run["verified"]:
        return f"{html.escape(run['failure_kind'] or 'failed')}{share}"
    return f"<b>{number(run['duration'])} s</b>{share}"


def _told(run: Mapping[str, Any], good: int, tried: int) -> list[str]:
    """What a tip tells of a run, line by line."""
    lines = [f"{good} of {tried} runs verified; seed {run['seed']}:"] if tried > 1 else []
    if run["verified"]:
        bound = "" if run["ratio"] is None else f", {number(run['ratio'])} × bound"
        lines.append(f"motion {number(run['duration'])} s{bound}")
    elif run["failure_kind"]:
        lines.append(f"{run['failure_kind']}: {(run['failure_detail'] or '')[:160]}")
    if run["plan_time"] is not None:
        lines.append(f"planned in {number(run['plan_time'])} s")
    if run["clearance"] is not None:
        lines.append(f"clearance proved {1e3 * run['clearance']:.2f} mm")
    return lines
