"""Run a suite into a folder: stored runs are kept, missing ones are made, every run once."""

import json
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path

from optiplan.bench.execution.machine import machine
from optiplan.bench.execution.pool import Workforce
from optiplan.bench.results.database import FILE, Store
from optiplan.bench.results.records import Outcome
from optiplan.bench.suite.suite import Suite, code_differences, differences
from optiplan.errors import InputError, Issue, OptiPlanError
from optiplan.runs.run import versions

Watch = Callable[[Outcome], None]
"""Told every outcome once it is stored."""


class CodeError(OptiPlanError):
    """Code that was changed while a suite was run."""


@dataclass(frozen=True)
class Summary:
    """Progress of a suite: all runs, those found in the folder, those made in this session."""

    total: int
    found: int
    made: int

    @property
    def complete(self) -> bool:
        """Whether every run is there."""
        return self.found + self.made == self.total


def open_results(suite: Suite, folder: Path) -> Store:
    """Open the results of this suite in a folder for writing; create them if missing.

    Raises:
        InputError: the folder holds the results of another suite or of other code (what differs is named), or another
            process is writing to them.
        StoreError: the folder cannot be written.
    """
    if (folder / FILE).exists():
        store = Store(folder, write=True)
    else:
        meta: dict[str, object] = {"name": suite.spec.name, "suite": suite.text, "suite_hash": suite.hash}
        meta |= {"parts": suite.parts, "code": suite.code}
        store = Store.create(folder, meta)
    words = differences(store.meta("parts"), suite.parts)
    issues = [f"results of another suite: {text}" for text in words]
    issues += [f"results of other code: {text}" for text in code_differences(store.code, suite.code)]
    if issues:
        store.close()
        expected = "the same suite and code (or choose another folder with --out)"
        raise InputError(Issue(str(folder), None, "suite", text, expected) for text in issues)
    store.fill(suite.problems, suite.planners)
    return store


def other_versions(store: Store) -> list[str]:
    """Return the differences of today's versions from those of earlier runs, in words."""
    words = []
    now = versions()
    for row in store.query("SELECT DISTINCT versions FROM sessions"):
        then = json.loads(row["versions"])
        words += [
            f"{name}: {then.get(name)} before, {found} now" for name, found in now.items() if then.get(name) != found
        ]
    return list(dict.fromkeys(words))


def run_suite(suite: Suite, store: Store, workforce: Workforce, label: str, watch: Watch) -> Summary:
    """Make the runs that are missing.

    Args:
        suite: what is to be run.
        store: its results, from `open_results`.
        workforce: carries out the tasks; closing it from elsewhere (a signal's handler) ends this with what is stored.
        label: of the workforce, for table `sessions`.
        watch: called with every outcome once it is stored.

    Raises:
        StoreError: a run cannot be stored; those before it are.
        WorkerError: no worker can be started.
        CodeError: code was changed since the suite was read.
    """
    there = store.done()
    made = 0
    store.begin(label, machine(), versions())
    how = "failed"
    try:
        with closing(workforce.outcomes(task for task in suite.tasks() if task.key not in there)) as outcomes:
            for outcome in outcomes:
                outcome = _with_code(outcome, suite)
                store.add(outcome)
                made += 1
                watch(outcome)
        summary = Summary(suite.size, len(there), made)
        how = "complete" if summary.complete else "interrupted"
        return summary
    finally:
        workforce.close()
        if how != "failed":  # where storing failed, storing why would fail, too
            store.end(how)


def _with_code(outcome: Outcome, suite: Suite) -> Outcome:
    """Return the outcome with the code it was made by, also where its process died first.

    Raises:
        CodeError: a worker that was started later has read other code than the suite's.
    """
    row = outcome.row
    theirs = suite.code["planners"][row.planner]
    if row.optiplan and (row.optiplan, row.code) != (suite.code["digest"], theirs):
        raise CodeError(
            f"the code of planner '{row.planner}' or of optiplan was changed while the suite was run: "
            "what was stored is of the code before; run the suite into another folder"
        )
    return replace(outcome, row=replace(row, optiplan=suite.code["optiplan"], code=theirs))
