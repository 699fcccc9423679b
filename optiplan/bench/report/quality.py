"""Quality against time: how good the best verified answer was by then, of planners that go on improving it.

Quality of an answer is its duration / the best known duration of its problem: the shortest verified one of any run.
A run without an answer yet counts as one of infinite duration, so no planner looks good by solving easy problems only.
"""

from typing import NamedTuple

import numpy as np

from optiplan.arrays import Array
from optiplan.bench.results.arrays import Indices, Runs
from optiplan.bench.results.measures import RunAnswers
from optiplan.bench.statistics.intervals_and_tests import Interval, median_interval

TIMES = (0.1, 1.0, 10.0)
"""s of planning and proving at which answers are looked at."""

NEVER = 1e9
"""Stands for an infinite ratio where ratios are averaged."""


class PlannerQuality(NamedTuple):
    """Quality of one planner's answers at `TIMES`, and in the end.

    Attributes:
        label: of the planner.
        answered: share of all its runs that have a verified answer by then.
        ratio: median over all its runs of duration / best known; inf where fewer than half have an answer.
    """

    label: str
    answered: tuple[float, ...]
    ratio: tuple[Interval, ...]


class Quality(NamedTuple):
    """Quality of all planners' answers.

    Attributes:
        planners: at `TIMES` and in the end.
        curves: of each planner times (k,), s, ascending, and the median ratio from then on, (k,); inf before half of
            its runs have an answer.
    """

    planners: tuple[PlannerQuality, ...]
    curves: tuple[tuple[Array, Array], ...]


def quality(runs: Runs, answers: RunAnswers, known: Array) -> Quality:
    """Quality of all planners; `known` (problems,), s, are best known from elsewhere."""
    best = np.minimum(best_known(runs, answers), known)
    ratio = answers.duration / best[runs.problem[answers.run]] if len(answers.run) else answers.duration
    found, curves = [], []
    for k, label in enumerate(runs.planners):
        mine = np.flatnonzero(runs.planner == k)
        own = np.isin(answers.run, mine)
        place = np.searchsorted(mine, answers.run[own])
        seconds, ratios = answers.seconds[own], ratio[own]
        rows = [_at(time, len(mine), place, (seconds, ratios)) for time in (*TIMES, np.inf)]
        shares = tuple(float(np.isfinite(row).mean()) if len(row) else float("nan") for row in rows)
        medians = tuple(_median(row, runs.problem[mine]) for row in rows)
        found.append(PlannerQuality(label, shares, medians))
        curves.append(_curve(len(mine), place, seconds, ratios))
    return Quality(tuple(found), tuple(curves))


def best_known(runs: Runs, answers: RunAnswers) -> Array:
    """Shortest verified duration of each problem by any run, s: (problems,); inf where there is none."""
    best = np.full(len(runs.problems), np.inf)
    np.minimum.at(best, runs.problem[answers.run], answers.duration)
    good = runs.verified & np.isfinite(runs.duration)
    np.minimum.at(best, runs.problem[good], runs.duration[good])
    return best


def _at(time: float, count: int, run: Indices, answers: tuple[Array, Array]) -> Array:
    """Best ratio (count,) of each of a planner's runs by a time, s; inf without an answer."""
    seconds, ratio = answers
    best = np.full(count, np.inf)
    early = seconds <= time
    np.minimum.at(best, run[early], ratio[early])
    return best


def _median(ratio: Array, problem: Indices) -> Interval:
    found = median_interval(np.minimum(ratio, NEVER), problem)
    # Medians and ends of intervals lie between two values, so they may take a small part of NEVER.
    return Interval(*(np.inf if value > 1e-3 * NEVER else value for value in found))


def _curve(count: int, run: Indices, seconds: Array, ratio: Array) -> tuple[Array, Array]:
    """Times of answers, ascending, and the median ratio of `count` runs from each on."""
    order = np.argsort(seconds, kind="stable")
    best, medians = np.full(count, np.inf), []
    thin = max(1, len(order) // 400)  # more steps cannot be seen
    for number, k in enumerate(order):
        best[run[k]] = min(best[run[k]], ratio[k])
        if number % thin == thin - 1 or number == len(order) - 1:
            medians.append((seconds[k], float(np.median(best))))
    table = np.array(medians).reshape(-1, 2)
    return table[:, 0], table[:, 1]
