"""The report's summary: which planner to take, and which warnings apply."""

import html
import json
import math
from collections.abc import Sequence

from optiplan.bench.report.analysis import Analysis, PlannerNumbers
from optiplan.bench.report.tables.cells import number, percent
from optiplan.bench.results.database import Store
from optiplan.bench.results.growth import expected_runs

BROKEN = ("timeout", "out-of-memory", "crashed", "bug", "bad-input")
"""How kinds of failures begin that tell of a fault, not of a hard problem."""

Card = tuple[str, str, str]
"""Heading, the few words that answer it, and what they rest on, as HTML."""


def cards(analysis: Analysis) -> list[Card]:
    """Return the summary cards."""
    planners = [one for one in analysis.planners if one.runs]
    if not planners:
        return [("No runs yet", "–", "The suite has not been run.")]
    best = max(one.success.value for one in planners)
    first = [one for one in planners if one.success.value == best]
    top = first[0]
    every = f"{top.verified} of {top.runs} runs" if len({one.runs for one in first}) == 1 else "of their runs"
    ends = top.success.ends
    sure = "" if ends is None else f", 95 % confidence {' to '.join(map(percent, ends))}"
    found = [("Most reliable", _names(first), f"verified {percent(best)}: {every}{sure}")]
    if best > 0.0 and len(planners) > 1 and analysis.common:
        times = [(one.plan_time.median.value, one.quickest, one) for one in planners]
        ratios = [(one.ratio.median.value, one.shortest, one) for one in planners]
        for words, scored in (
            (("Quickest to plan", "s", "first"), times),
            (("Shortest motions", "× bound", "shortest"), ratios),
        ):  # imported runs may tell no time, and robots that need not move have no bound
            if not all(math.isnan(median) for median, *_ in scored):
                found.append(_by_median(*words, scored))
    return found


def _by_median(heading: str, unit: str, what: str, scored: Sequence[tuple[float, float, PlannerNumbers]]) -> Card:
    """Return the card of the least median, as the tables have it, and of who is ahead most often.

    Args:
        heading: of the card.
        unit: of the medians.
        what: it means to be ahead on a task.
        scored: median over the verified runs, share of the tasks on which it is ahead, planner.
    """
    least = _leaders([(-median, one) for median, _, one in scored])
    ranked = sorted((median, one.label) for median, _, one in scored if not math.isnan(median))
    medians = ", ".join(f"{label} {number(median)}" for median, label in ranked[:3])
    often = _leaders([(share, one) for _, share, one in scored])
    share = next(share for _, share, one in scored if one is often[0])
    ahead = f"most often {what}: {_names(often)}, {percent(share)} of the tasks"
    rests = f"median of the verified runs, {unit}: {html.escape(medians)}; {ahead}"
    return (f"{heading}, median", _names(least), rests)


def _leaders(scored: list[tuple[float, PlannerNumbers]]) -> list[PlannerNumbers]:
    known = [pair for pair in scored if not math.isnan(pair[0])]
    best = max(score for score, _ in known)
    return [one for score, one in known if score == best]


def _names(found: list[PlannerNumbers]) -> str:
    if len(found) > 3:
        return f"{len(found)} planners alike"
    return " · ".join(html.escape(one.label) for one in found)


def facts(store: Store, analysis: Analysis) -> str:
    """Return the size of the suite in one line."""
    runs = analysis.runs
    verified = percent(float(runs.verified.mean())) if runs.size else "0 %"
    expected = expected_runs(store)
    of_all = f"{runs.size} of {expected}" if expected != runs.size else f"{runs.size}"
    return f"{len(runs.problems)} problems × {len(runs.planners)} planners: {of_all} runs, {verified} verified"


def warnings(store: Store, analysis: Analysis) -> list[str]:
    """Return what limits the validity of the report."""
    runs, found = analysis.runs, []
    expected = expected_runs(store)
    if runs.size < expected:
        found.append(f"Not complete: {expected - runs.size} of {expected} runs are missing.")
    broken = sum(any(str(kind).startswith(word) for word in BROKEN) for kind in runs.kind)
    if broken:
        found.append(f"{broken} runs ended by a fault (crash, time-out, memory, bug, bad input): see failures.")
    cut = int(runs.cut_short.sum())
    if cut:
        found.append(f"The clock ended some of the work in {cut} runs: on another machine they may come out otherwise.")
    found += [f"Of several folders: {text}." for text in store.meta("notes", ())]
    for column, what in (("machine", "machines"), ("versions", "versions of the software")):
        kept = [json.loads(row[0]) for row in store.query(f"SELECT DISTINCT {column} FROM sessions")]
        for one in kept:
            one.pop("load", None)
        if len({json.dumps(one, sort_keys=True) for one in kept}) > 1:
            found.append(f"The runs were made on several {what}: their times are not of one kind.")
    return found
