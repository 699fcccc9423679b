"""Stored runs for the viewer: motions verified again, or the witness of a failure; and pages of them beside a report.

The pages are for links that work without a server: problems compared, and a failure for each reason.
"""

import hashlib
import json
from collections.abc import Iterable, Sequence
from pathlib import Path

from optiplan.bench.report.failures import Failed, Reason
from optiplan.bench.results.database import Store
from optiplan.bench.results.records import Key
from optiplan.errors import InputError, Issue, OptiPlanError, errors_about
from optiplan.planners.base import Progress
from optiplan.problem.from_python import NO_FILE
from optiplan.problem.load import problem_from_dict
from optiplan.problem.problem import Problem
from optiplan.verify.verify import verify
from optiplan.viewer.page import export_page
from optiplan.viewer.runs import ViewedRun

FOLDER = "report-scenes"
MOST = 10
"""Scenes of failures that are written: of the most frequent reasons. Each is a page of a megabyte or more."""
PAGES = 6
"""Problems with a page of all their planners, unless asked for more or fewer."""


def stored_views(store: Store, keys: Sequence[Key]) -> tuple[Problem, list[ViewedRun]]:
    """Return the problem of several runs, and the data to show them together.

    Raises:
        InputError: there is no such run, or its problem cannot be loaded (which may be why a run failed).
        UnknownChoiceError: there is no such problem.
    """
    id_ = keys[0][0]
    with errors_about(NO_FILE, f"{store.folder}: {id_}"):
        problem = problem_from_dict(store.problem(id_).data)
    return problem, [_view(store, problem, key) for key in keys]


def keys_of(store: Store, problem: str, planners: str, seed: int, repetition: int) -> list[Key]:
    """Return the keys of runs by planner: one label, several between commas, or `all` that have such a run.

    Raises:
        UnknownChoiceError: there is no such problem.
    """
    store.problem(problem)
    labels = [row["label"] for row in store.query("SELECT label FROM planners ORDER BY position")]
    if planners == "all":
        done = store.done()
        found = [label for label in labels if (problem, label, seed, repetition) in done]
        return [(problem, label, seed, repetition) for label in found or labels[:1]]
    names = [planners] if planners in labels else planners.split(",")
    return [(problem, name, seed, repetition) for name in dict.fromkeys(names)]


def write_scenes(store: Store, found: Iterable[Reason], page: Path) -> dict[Failed, str]:
    """Write the scenes of failures; addresses relative to the page, by run. A run that cannot be loaded has none."""
    addresses: dict[Failed, str] = {}
    for reason in list(found)[:MOST]:
        run = next((one for one in reason.examples if one.seen), reason.examples[0])
        name = _name(run.key)
        try:
            problem, views = stored_views(store, [run.key])
            export_page(problem, views, page.parent / FOLDER / name, back=_back(page, "failures"))
        except (OptiPlanError, OSError):
            continue
        addresses[run] = f"{FOLDER}/{name}"
    return addresses


def write_comparisons(
    store: Store, runs: Sequence[tuple[str, Sequence[Key]]], page: Path, progress: Progress
) -> dict[str, str]:
    """Write a page for each problem with the runs that stand for its planners; addresses relative to the report."""
    addresses: dict[str, str] = {}
    for k, (problem_id, keys) in enumerate(runs):
        progress(f"page of {problem_id}", k / len(runs))
        name = _name(("compared", problem_id))
        try:
            problem, views = stored_views(store, keys)
            export_page(problem, views, page.parent / FOLDER / name, back=_back(page, "matrix"))
        except (OptiPlanError, OSError):
            continue
        addresses[problem_id] = f"{FOLDER}/{name}"
    return addresses


def _view(store: Store, problem: Problem, key: Key) -> ViewedRun:
    rows = store.query("SELECT * FROM runs WHERE problem = ? AND planner = ? AND seed = ? AND repetition = ?", key)
    if not rows:
        raise InputError([Issue(str(store.folder), None, "run", f"no run {key}", _choices(store, key[0]))])
    row = rows[0]
    trajectory = None if row["trajectory"] is None else store.trajectory(row["trajectory"])
    measured = {"planner": row["planner"], "seed": row["seed"], "timings": {"plan": row["plan_time"]}}
    if trajectory is not None:
        measured["metrics"] = json.loads(row["metrics"] or "{}")
        return ViewedRun(row["planner"], trajectory, verify(problem, trajectory).to_dict(), None, measured)
    witness = json.loads(row["witness"] or "null")
    failure = {"kind": row["failure_kind"], "detail": row["failure_detail"], "witness": witness}
    return ViewedRun(row["planner"], None, None, failure, measured)


def _choices(store: Store, problem: str) -> str:
    rows = store.query("SELECT DISTINCT planner, seed, repetition FROM runs WHERE problem = ?", (problem,))
    if not rows:
        return "a run that was made: this problem has none yet"
    names = [", ".join(dict.fromkeys(str(row[k]) for row in rows)) for k in range(3)]
    return f"planner {names[0]}; seed {names[1]}; repetition {names[2]}"


def _name(key: object) -> str:
    return f"{hashlib.sha256(repr(key).encode()).hexdigest()[:16]}.html"


def _back(page: Path, section: str) -> tuple[str, str]:
    return f"../{page.name}#{section}", "report"
