"""Run a suite into a folder: stored runs are kept, missing ones are made, every run once."""

import json
from collections.abc import Callable
from contextlib import closing
from dataclasses import replace
from pathlib import Path

from optiplan.bench.execution.machine import machine
from optiplan.bench.execution.pool import Workforce
from optiplan.bench.results.database import FILE, Store
from optiplan.bench.results.growth import grown, grown_code, suite_runs, suites_of
from optiplan.bench.results.records import ChangedError, Outcome
from optiplan.bench.suite.suite import Suite, code_differences, hash_of_parts, suite_differences
from optiplan.errors import InputError, Issue
from optiplan.records import dataclass
from optiplan.runs.run import versions

Watch = Callable[[Outcome], None]
"""Told every outcome once it is stored."""


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


def open_results(suite: Suite, folder: Path, add: bool = False) -> Store:
    """Open the results of this suite in a folder for writing; create them if missing.

    Args:
        suite: what is to be run.
        folder: of the results.
        add: the folder may hold results of another suite, to which this one adds planners, problems, seeds or
            repetitions; `growth` says what has to agree.

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
    try:
        suites, asked = suites_of(store), suite_runs(suite.parts)
        (_grow if add else _check)(store, suite)
        if asked not in suites:
            store.set_meta("suites", [*suites, asked])
        store.fill(suite.problems, suite.planners)
    except BaseException:
        store.close()
        raise
    return store


def _check(store: Store, suite: Suite) -> None:
    """Refuse results of another suite or of other code."""
    words = suite_differences(store.meta("parts"), suite.parts)
    issues = [f"results of another suite: {text}" for text in words]
    others = [f"results of other code: {text}" for text in code_differences(store.code, suite.code)]
    expected = "the same suite and code (or choose another folder with --out)"
    if issues and not others and not grown(store.meta("parts"), suite.parts)[1]:
        expected = "the same suite (or add this one to it with --add, or choose another folder with --out)"
    if issues or others:
        raise InputError(Issue(str(store.folder), None, "suite", text, expected) for text in (*issues, *others))


def _grow(store: Store, suite: Suite) -> None:
    """Write that the results are of both suites."""
    old = store.meta("parts")
    parts, unlike = grown(old, suite.parts)
    code, other = grown_code(store.code, suite.code)
    if unlike or other:
        expected = "what the folder has, and planners, problems or seeds besides (or another folder with --out)"
        raise InputError(Issue(str(store.folder), None, "add", text, expected) for text in (*unlike, *other))
    if parts != old:
        whole = parts == grown(suite.parts, suite.parts)[0]  # an edited suite says all; one that only adds does not
        store.set_meta("suite", suite.text if whole else f"{store.meta('suite')}\n---\n{suite.text}")
        store.set_meta("suite_hash", hash_of_parts(parts))
        store.set_meta("parts", parts)
        store.set_meta("code", code)


def found_runs(suite: Suite, store: Store) -> int:
    """Number of the suite's runs that are stored."""
    done = store.done()
    return sum(task.key in done for task in suite.tasks())


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
        ChangedError: code, a robot or a mesh was changed since the suite was read.
    """
    there, found = store.done(), found_runs(suite, store)
    made = 0
    store.begin(label, machine(), versions())
    how = "failed"
    try:
        with closing(workforce.outcomes(task for task in suite.tasks() if task.key not in there)) as outcomes:
            for outcome in outcomes:
                outcome = _checked(outcome, suite)
                store.add(outcome)
                made += 1
                watch(outcome)
        summary = Summary(suite.size, found, made)
        how = "complete" if summary.complete else "interrupted"
        return summary
    except KeyboardInterrupt:
        how = "interrupted"
        raise
    finally:
        workforce.close()
        if how != "failed":  # where storing failed, storing why would fail, too
            store.end(how)


def _checked(outcome: Outcome, suite: Suite) -> Outcome:
    """Return the outcome with the code it was made by, also where its process died first.

    Raises:
        ChangedError: a worker has read other files of the problem, or one that was started later other code, than the
            suite's.
    """
    row = outcome.row
    if row.failure_kind == "changed":
        raise ChangedError(row.failure_detail)
    theirs = suite.code["planners"][row.planner]
    if row.optiplan and (row.optiplan, row.code) != (suite.code["digest"], theirs):
        raise ChangedError(
            f"the code of planner '{row.planner}' or of optiplan was changed while the suite was run: "
            "what was stored is of the code before; run the suite into another folder"
        )
    return replace(outcome, row=replace(row, optiplan=suite.code["optiplan"], code=theirs))
