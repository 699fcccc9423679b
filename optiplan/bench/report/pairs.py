"""Paired comparison of planners on the problems that both solve: planning time, duration, significance.

The unit is the problem: its runs (seeds, repetitions) are alike, so they are taken together, by the geometric mean of
the ratio over the runs that both solved.
"""

from itertools import combinations
from typing import NamedTuple

import numpy as np

from optiplan.arrays import Array
from optiplan.bench.results.arrays import Grid, Indices, Runs
from optiplan.bench.statistics.intervals_and_tests import TIE, Interval, median_interval, sign_test, signed_rank_test


class Paired(NamedTuple):
    """A cost of two planners on the same problems.

    Attributes:
        ratio: median over problems of cost of the first / cost of the second.
        wins: problems on which the first costs less, beyond 1 %.
        losses: problems on which it costs more.
        sign: probability of wins and losses so uneven by chance, sign test.
        rank: the same by Wilcoxon's signed ranks of the ratios' logarithms.
    """

    ratio: Interval
    wins: int
    losses: int
    sign: float
    rank: float


class PlannerPair(NamedTuple):
    """Two planners compared.

    Attributes:
        first, second: labels.
        problems: solved by both at least once with the same seed and repetition.
        only_first, only_second: runs that one of them solved and the other did not.
        plan_time, duration: compared.
    """

    first: str
    second: str
    problems: int
    only_first: int
    only_second: int
    plan_time: Paired
    duration: Paired


def pairs(runs: Runs, grid: Grid) -> tuple[PlannerPair, ...]:
    """Every two planners."""
    problem = grid.tasks[:, 0]
    logs = [np.log(costs) for costs in (grid.plan_time, grid.duration)]
    found = []
    for a, b in combinations(range(len(runs.planners)), 2):
        both = grid.there[:, a] & grid.there[:, b]
        one, other = grid.verified[:, a], grid.verified[:, b]
        compared = [paired(log[:, a] - log[:, b], problem) for log in logs]
        found.append(
            PlannerPair(
                runs.planners[a],
                runs.planners[b],
                len(np.unique(problem[one & other])),
                int((both & one & ~other).sum()),
                int((both & other & ~one).sum()),
                *compared,
            )
        )
    return tuple(found)


def paired(differences: Array, problem: Indices) -> Paired:
    """Compare by the logarithms of ratios.

    Args:
        differences: (m,), ln(cost of the first / cost of the second) of runs; nan where one of them has none.
        problem: (m,), which problem a run is of.
    """
    each = by_problem(differences, problem)
    middle = median_interval(each)
    beyond = np.where(np.abs(each) > np.log1p(TIE), each, 0.0)
    wins, losses = int((beyond < 0.0).sum()), int((beyond > 0.0).sum())
    ratio = Interval(*(float(np.exp(value)) for value in middle))
    return Paired(ratio, wins, losses, sign_test(wins, losses), signed_rank_test(beyond))


def by_problem(differences: Array, problem: Indices) -> Array:
    """Means (k,) of what is known of each problem, of values (m,) where nan is not known."""
    known = np.isfinite(differences)
    _, place = np.unique(problem[known], return_inverse=True)
    return np.asarray(np.bincount(place, differences[known]) / np.bincount(place), dtype=np.float64)
