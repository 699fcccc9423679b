"""Stored run for the viewer: its motion verified again, or the witness of its failure."""

import json
from collections.abc import Sequence

from optiplan.bench.results.database import Store
from optiplan.bench.results.records import Key
from optiplan.errors import InputError, Issue
from optiplan.problem.load import problem_from_dict
from optiplan.problem.problem import Problem
from optiplan.verify.verify import verify
from optiplan.viewer.runs import ViewedRun


def stored_view(store: Store, key: Key) -> tuple[Problem, ViewedRun]:
    """Return the problem of a run, and the data to show of the run.

    Raises:
        InputError: there is no such run, or its problem cannot be loaded (which may be why the run failed).
        UnknownChoiceError: there is no such problem.
    """
    problem = problem_from_dict(store.problem(key[0]).data)
    return problem, _view(store, problem, key)


def stored_views(store: Store, keys: Sequence[Key]) -> tuple[Problem, list[ViewedRun]]:
    """Return the problem of several runs, and the data to show them together.

    Raises:
        InputError, UnknownChoiceError: as `stored_view`.
    """
    problem = problem_from_dict(store.problem(keys[0][0]).data)
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


def _view(store: Store, problem: Problem, key: Key) -> ViewedRun:
    rows = store.query("SELECT * FROM runs WHERE problem = ? AND planner = ? AND seed = ? AND repetition = ?", key)
    if not rows:
        raise InputError([Issue(str(store.folder), None, "run", f"no run {key}", _choices(store, key[0]))])
    row = rows[0]
    trajectory = None if row["trajectory"] is None else store.trajectory(row["trajectory"])
    if trajectory is not None:
        return ViewedRun(row["planner"], trajectory, verify(problem, trajectory).to_dict())
    witness = json.loads(row["witness"] or "null")
    failure = {"kind": row["failure_kind"], "detail": row["failure_detail"], "witness": witness}
    return ViewedRun(row["planner"], None, None, failure)


def _choices(store: Store, problem: str) -> str:
    rows = store.query("SELECT DISTINCT planner, seed, repetition FROM runs WHERE problem = ?", (problem,))
    if not rows:
        return "a run that was made: this problem has none yet"
    names = [", ".join(dict.fromkeys(str(row[k]) for row in rows)) for k in range(3)]
    return f"planner {names[0]}; seed {names[1]}; repetition {names[2]}"
