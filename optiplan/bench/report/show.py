"""Stored run for the viewer: its motion verified again, or the witness of its failure."""

import json

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
    rows = store.query("SELECT * FROM runs WHERE problem = ? AND planner = ? AND seed = ? AND repetition = ?", key)
    if not rows:
        raise InputError([Issue(str(store.folder), None, "run", f"no run {key}", _choices(store, key[0]))])
    row = rows[0]
    trajectory = None if row["trajectory"] is None else store.trajectory(row["trajectory"])
    if trajectory is not None:
        return problem, ViewedRun(row["planner"], trajectory, verify(problem, trajectory).to_dict())
    witness = json.loads(row["witness"] or "null")
    failure = {"kind": row["failure_kind"], "detail": row["failure_detail"], "witness": witness}
    return problem, ViewedRun(row["planner"], None, None, failure)


def _choices(store: Store, problem: str) -> str:
    rows = store.query("SELECT DISTINCT planner, seed, repetition FROM runs WHERE problem = ?", (problem,))
    if not rows:
        return "a run that was made: this problem has none yet"
    names = [", ".join(dict.fromkeys(str(row[k]) for row in rows)) for k in range(3)]
    return f"planner {names[0]}; seed {names[1]}; repetition {names[2]}"
