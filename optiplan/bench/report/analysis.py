"""Statistics of a report, from the runs alone.

A run succeeds when it is *verified*. Times and durations are of verified runs only; a failure has none, and counts as
a failure wherever shares of all runs are told.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from optiplan.arrays import Array, Flags
from optiplan.bench.report.pairs import PlannerPair, pairs
from optiplan.bench.report.quality import Quality, quality
from optiplan.bench.results.arrays import Indices, Runs
from optiplan.bench.results.database import Store
from optiplan.bench.results.measures import Results, RunMeasure, load_results
from optiplan.bench.statistics.intervals_and_tests import (
    TIE,
    Interval,
    median_interval,
    median_of_known,
    performance_ratios,
    share_intervals,
)

PERCENTILES = (50, 75, 95, 99)
USUAL = ("easy", "medium", "hard")
"""Difficulties that everybody would put in this order."""


class Spread(NamedTuple):
    """Distribution of a quantity over verified runs: count, median, percentiles 50, 75, 95, 99, and 5, 25."""

    runs: int
    median: Interval
    percentiles: tuple[float, ...]
    lower: tuple[float, float] = (np.nan, np.nan)


class PlannerNumbers(NamedTuple):
    """Results of one planner.

    Attributes:
        label: of the planner.
        runs: number of stored runs.
        planned, timed, verified: how many got so far.
        executed: number followed by a controller; None where that was not tried.
        path_found, has_times, success: share of runs that found a path, whose path got times, that are verified.
        plan_time: s by the clock, of verified runs.
        plan_cpu: s of the processor, of planning alone, likewise.
        ratio: duration / bound of the problem, of verified runs.
        quickest: share of tasks on which no planner was quicker; of those that all planners were given.
        shortest: share of tasks on which no motion was shorter; likewise.
        cut_short: runs in which the clock ended some of the work.
    """

    label: str
    runs: int
    planned: int
    timed: int
    verified: int
    executed: int | None
    path_found: Interval
    has_times: Interval
    success: Interval
    plan_time: Spread
    plan_cpu: Spread
    ratio: Spread
    quickest: float
    shortest: float
    cut_short: int


class SubsetSummary(NamedTuple):
    """Some of the problems (a set, a difficulty): success and median planning time (s; nan without) by planner."""

    name: str
    problems: int
    success: tuple[Interval, ...]
    plan_time: tuple[float, ...]
    ratio: tuple[float, ...]


class Analysis(NamedTuple):
    """Everything that is reported.

    Attributes:
        runs: what it is of.
        planners: numbers of each, in the suite's order.
        sets, difficulties: by part of the problems; empty where there is but one.
        common: tasks that all planners were given.
        time_ratios, duration_ratios: (tasks, planners), Dolan and More's ratios over the common tasks.
        pairs: comparisons of two planners each.
        measures: every stored number of the runs.
        spreads: of each measure the distribution over each planner's verified runs.
        quality: how good answers were by when.
    """

    runs: Runs
    planners: tuple[PlannerNumbers, ...]
    sets: tuple[SubsetSummary, ...]
    difficulties: tuple[SubsetSummary, ...]
    common: int
    time_ratios: Array
    duration_ratios: Array
    pairs: tuple[PlannerPair, ...]
    measures: tuple[RunMeasure, ...]
    spreads: tuple[tuple[Spread, ...], ...]
    quality: Quality


def analyse(store: Store) -> Analysis:
    """Numbers of all runs that are stored."""
    return analyse_results(load_results(store))


def analyse_results(results: Results, compared: bool = True) -> Analysis:
    """Numbers of some runs; `compared`: with every two planners compared."""
    runs = results.runs
    grid = runs.grid()
    common = grid.there.all(axis=1)
    times, durations = (performance_ratios(costs[common]) for costs in (grid.plan_time, grid.duration))
    stages = [_shares(runs, np.ones(runs.size, bool), flags) for flags in (runs.planned, runs.timed, runs.verified)]
    numbers = []
    for k in range(len(runs.planners)):
        firsts = [_share(ratios[:, k] <= 1.0 + TIE) for ratios in (times, durations)]
        numbers.append(_planner(runs, k, firsts, [stage[k] for stage in stages]))
    return Analysis(
        runs,
        tuple(numbers),
        _parts(runs, runs.sets),
        _parts(runs, [label or "no label" for label in runs.difficulties]) if any(runs.difficulties) else (),
        int(common.sum()),
        times,
        durations,
        pairs(runs, grid) if compared else (),
        results.measures,
        tuple(_spreads(runs, measure) for measure in results.measures),
        quality(runs, results.answers, results.known),
    )


def _spreads(runs: Runs, measure: RunMeasure) -> tuple[Spread, ...]:
    """Distribution of a measure over the verified runs of each planner."""
    masks = [(runs.planner == k) & runs.verified for k in range(len(runs.planners))]
    return tuple(_spread(measure.values[mask], runs.problem[mask]) for mask in masks)


def _shares(runs: Runs, part: Flags, flags: Flags) -> list[Interval]:
    """Share of runs with a flag (n,), of every planner on part of the runs (n,), by problems."""
    shape = (len(runs.problems), len(runs.planners))
    good, tries = np.zeros(shape), np.zeros(shape)
    np.add.at(tries, (runs.problem[part], runs.planner[part]), 1.0)
    np.add.at(good, (runs.problem[part], runs.planner[part]), flags[part])
    there = tries.any(axis=1)
    return share_intervals(good[there], tries[there])


def _planner(runs: Runs, k: int, firsts: Sequence[float], stages: Sequence[Interval]) -> PlannerNumbers:
    mine = runs.planner == k
    verified = mine & runs.verified
    tried = mine & np.isfinite(runs.executed)
    planned, timed, good = (int((mine & flags).sum()) for flags in (runs.planned, runs.timed, runs.verified))
    costs = (runs.plan_time, runs.plan_cpu, runs.ratio)
    plan_time, plan_cpu, ratio = (_spread(x[verified], runs.problem[verified]) for x in costs)
    return PlannerNumbers(
        label=runs.planners[k],
        runs=int(mine.sum()),
        planned=planned,
        timed=timed,
        verified=good,
        executed=int(runs.executed[tried].sum()) if tried.any() else None,
        path_found=stages[0],
        has_times=stages[1],
        success=stages[2],
        plan_time=plan_time,
        plan_cpu=plan_cpu,
        ratio=ratio,
        quickest=firsts[0],
        shortest=firsts[1],
        cut_short=int((mine & runs.cut_short).sum()),
    )


def _spread(values: Array, problems: Indices) -> Spread:
    known = np.isfinite(values)
    values = values[known]
    if len(values) == 0:
        return Spread(0, median_interval(values), (np.nan,) * len(PERCENTILES))
    percentiles = np.percentile(values, PERCENTILES)
    low, quarter = map(float, np.percentile(values, (5, 25)))
    middle = median_interval(values, problems[known])
    return Spread(len(values), middle, tuple(map(float, percentiles)), (low, quarter))


def _parts(runs: Runs, names: Sequence[str]) -> tuple[SubsetSummary, ...]:
    """Numbers by name of a problem's part: those of `USUAL` in its order, the others as they come."""
    order = sorted(dict.fromkeys(names), key=lambda name: USUAL.index(name) if name in USUAL else len(USUAL))
    part = np.array([order.index(name) for name in names], dtype=np.int64)
    of_run = part[runs.problem]
    found = []
    for number, name in enumerate(order):
        times, ratios = [], []
        for k in range(len(runs.planners)):
            good = (of_run == number) & (runs.planner == k) & runs.verified
            times.append(median_of_known(runs.plan_time[good]))
            ratios.append(median_of_known(runs.ratio[good]))
        success = tuple(_shares(runs, of_run == number, runs.verified))
        found.append(SubsetSummary(name, int((part == number).sum()), success, tuple(times), tuple(ratios)))
    return tuple(found)


def _share(flags: Flags) -> float:
    return float(flags.mean()) if len(flags) else float("nan")
