"""Compare an old and a new result of the same problems: changes and their significance.

Runs are compared in pairs of the same problem (by content), planner, seed and repetition; what has no counterpart is
told, and left out. As in the report the unit is the problem: its runs are taken together.

| quantity | counts as changed when | test |
|---|---|---|
| success | a problem has more or fewer verified runs | sign test over problems |
| planning time | median ratio beyond 1.20 or below 1 / 1.20, processor time's, too | signed ranks over problems |
| duration | median ratio beyond 1.02 or below 1 / 1.02 | signed ranks over problems |

of those that both solve (of runs from elsewhere those that their authors call solved count for times and durations, not
for success: `CLAIMED`); and when, corrected by Holm for all quantities of all planners, such a change has a
probability below 0.05 by chance. Processor time has its say because a busy machine makes every planner slower:
measured, 2.6 times by the clock and 1.1 times by the processor at 2.5 times the load.
"""

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from optiplan.arrays import Flags
from optiplan.bench.report.pairs import paired
from optiplan.bench.results.arrays import Indices, Runs, load_runs
from optiplan.bench.results.database import Store
from optiplan.bench.results.imported import CLAIMED
from optiplan.bench.results.records import Key
from optiplan.bench.statistics.intervals_and_tests import ALPHA, Interval, holm, sign_test
from optiplan.bench.suite.suite import code_differences, suite_differences
from optiplan.config.messages import some

THRESHOLDS = {"success": 1.0, "planning time": 1.20, "duration": 1.02}
"""Median ratios up to which a change does not matter, however sure it is."""

REGRESSION, IMPROVEMENT, NONE = "regression", "improvement", "no change"


class Change(NamedTuple):
    """One quantity of one planner, before and after.

    Attributes:
        planner: its label.
        quantity: a key of `THRESHOLDS`.
        before, after: share of verified runs; or the median over runs that both solved, s. nan without any.
        ratio: median over problems of after / before, with its interval; nan for success.
        better, worse: problems with more and with fewer verified runs, or that cost less and more, beyond 1 %.
        p: probability of so uneven a change by chance.
        work: of planning time, median ratio of processor time; nan where it is not known.
        corrected: the same after Holm's correction for all changes that are looked at.
        verdict: `regression`, `improvement` or `no change`.
    """

    planner: str
    quantity: str
    before: float
    after: float
    ratio: Interval
    better: int
    worse: int
    p: float
    work: float = math.nan
    corrected: float = 1.0
    verdict: str = NONE


class Comparison(NamedTuple):
    """All that is found: common runs, notes on what is not common, changes, failures that are new and that are gone."""

    common: int
    notes: tuple[str, ...]
    changes: tuple[Change, ...]
    new_failures: tuple[tuple[Key, str], ...]
    fixed: tuple[tuple[Key, str], ...]

    def of(self, verdict: str) -> list[Change]:
        """Changes of one verdict."""
        return [change for change in self.changes if change.verdict == verdict]


def compare_results(old: Store, new: Store) -> Comparison:
    """Compare what two folders of results have in common."""
    a, b = load_runs(old), load_runs(new)
    changed = _changed_problems(old, new)
    keys = [_keys(runs, changed) for runs in (a, b)]
    common = [key for key in keys[0] if key in keys[1]]
    i, j = (np.array([places[key] for key in common], dtype=np.int64) for places in keys)
    found = [change for label in a.planners if label in b.planners for change in _changes(label, a, i, b, j)]
    judged = list(_judged(found))
    pairs = [(key, bool(a.verified[x]), bool(b.verified[y]), x, y) for key, x, y in zip(common, i, j, strict=True)]
    return Comparison(
        len(common),
        (*_notes(old, a, new, b, changed, len(common)), *_busy(judged)),
        tuple(judged),
        tuple((key, str(b.kind[y])) for key, was, now, x, y in pairs if was and not now and b.kind[y] != CLAIMED),
        tuple((key, str(a.kind[x])) for key, was, now, x, y in pairs if now and not was and a.kind[x] != CLAIMED),
    )


def _keys(runs: Runs, without: set[str]) -> dict[Key, int]:
    """Place of every run by its key, but for those of some problems."""
    columns = (runs.problem.tolist(), runs.planner.tolist(), runs.seed.tolist(), runs.repetition.tolist())
    keys = ((runs.problems[p], runs.planners[k], s, r) for p, k, s, r in zip(*columns, strict=True))
    return {key: place for place, key in enumerate(keys) if key[0] not in without}


def _changed_problems(old: Store, new: Store) -> set[str]:
    """Problems of both whose content differs."""
    before, after = ({row["id"]: row["hash"] for row in s.query("SELECT id, hash FROM problems")} for s in (old, new))
    return {id_ for id_ in before.keys() & after.keys() if before[id_] != after[id_]}


def _changes(label: str, a: Runs, i: Indices, b: Runs, j: Indices) -> Iterable[Change]:
    """The three quantities of a planner that has common runs, those at i of `a` and at j of `b`."""
    mine = a.planner[i] == a.planners.index(label)
    i, j = i[mine], j[mine]
    if len(i) == 0:
        return
    problem = a.problem[i]
    claimed = [runs.kind[k] == CLAIMED for runs, k in ((a, i), (b, j))]
    if not any(claims.any() for claims in claimed):  # a claim is no verdict
        yield _success(label, problem, a.verified[i], b.verified[j])
    both = (a.verified[i] | claimed[0]) & (b.verified[j] | claimed[1])
    i, j, problem = i[both], j[both], problem[both]
    work = paired(np.log(b.plan_cpu[j] / a.plan_cpu[i]), problem).ratio.value
    for quantity, before, after, by in (
        ("planning time", a.plan_time[i], b.plan_time[j], work),
        ("duration", a.duration[i], b.duration[j], math.nan),
    ):
        found = paired(np.log(after / before), problem)
        known = np.isfinite(before) & np.isfinite(after)  # a claim may be without a time
        medians = (float(np.median(values[known])) if known.any() else math.nan for values in (before, after))
        score = found.ratio, found.wins, found.losses, found.rank
        yield Change(label, quantity, next(medians), next(medians), *score, work=by)


def _success(label: str, problem: Indices, before: Flags, after: Flags) -> Change:
    gained = np.bincount(problem, after.astype(float) - before)
    better, worse = int((gained > 0.0).sum()), int((gained < 0.0).sum())
    rates, nothing = (float(before.mean()), float(after.mean())), Interval(math.nan, math.nan, math.nan)
    return Change(label, "success", *rates, nothing, better, worse, sign_test(better, worse))


def _judged(changes: list[Change]) -> Iterable[Change]:
    for change, p in zip(changes, holm([change.p for change in changes]), strict=True):
        yield change._replace(corrected=p, verdict=_verdict(change) if p < ALPHA else NONE)


def _verdict(change: Change) -> str:
    """Return the verdict on a significant change."""
    limit = THRESHOLDS[change.quantity]
    if change.quantity == "success":
        return REGRESSION if change.worse > change.better else IMPROVEMENT
    sizes = [change.ratio.value] if math.isnan(change.work) else [change.ratio.value, change.work]
    if min(sizes) > limit:
        return REGRESSION
    return IMPROVEMENT if max(sizes) < 1.0 / limit else NONE


def _busy(changes: list[Change]) -> Iterable[str]:
    """Return where wall-clock and processor time disagree."""
    for one in changes:
        limit = THRESHOLDS[one.quantity]
        if one.corrected < ALPHA and one.verdict == NONE and not 1.0 / limit <= one.ratio.value <= limit:
            ratios = f"planning time {one.ratio.value:.2f} times that of before, processor time {one.work:.2f} times"
            yield f"{one.planner}: {ratios}: the machine was busier or quieter, which is not the planner's doing"


def _notes(old: Store, a: Runs, new: Store, b: Runs, changed: set[str], common: int) -> Iterable[str]:
    """Return what the two sets do not share, and what makes times incomparable."""
    if old.meta("suite_hash") != new.meta("suite_hash"):
        yield f"the suites differ ('{old.meta('name')}' and '{new.meta('name')}'): only what is common is compared"
        words = suite_differences(old.meta("parts"), new.meta("parts"))
        yield from (text for text in words if not text.startswith("problems:"))  # these are counted below
    if changed:
        yield f"{len(changed)} problems have another content and are left out: {some(sorted(changed))}"
    for what, before, after in (("planner", a.planners, b.planners), ("problem", a.problems, b.problems)):
        for name, mine, others in (("A", before, after), ("B", after, before)):
            only = [item for item in mine if item not in set(others)]
            if only:
                yield f"{what}s only in {name}: {some(only)}"
    for name, runs in (("A", a), ("B", b)):
        if runs.size > common:
            yield f"{runs.size - common} of {runs.size} runs in {name} have no counterpart"
    yield from _origins(old, a, new, b)


def _origins(old: Store, a: Runs, new: Store, b: Runs) -> Iterable[str]:
    """Return the origin of the runs: foreign claims, code, versions, machines."""
    for name, runs in (("A", a), ("B", b)):
        claims = int((runs.kind == CLAIMED).sum())
        if claims:
            yield f"{claims} runs in {name} have no trajectory: times and durations as their authors tell, no verdict"
    words = code_differences(old.code, new.code) if old.code and new.code else []
    yield from (text.replace("there,", "before,").replace("here", "now") for text in words)
    for column, text in (("versions", "versions of the software"), ("machine", "machines (times may differ by that)")):
        before_, after_ = (_recorded(store, column) for store in (old, new))
        if before_ != after_:
            then, now = (some(sorted(only)) or "none" for only in (before_ - after_, after_ - before_))
            yield f"other {text}: {then} before, {now} now"


def _recorded(store: Store, column: str) -> set[str]:
    """Return the recorded machines or versions of all sessions, as `name value`."""
    ignored = ("load", "memory")
    sql = f"SELECT DISTINCT key || ' ' || value FROM sessions, json_each(sessions.{column}) WHERE key NOT IN (?, ?)"
    return {str(row[0]) for row in store.query(sql, ignored)}
