"""Statistics of a comparison: intervals, paired tests, curves.

The same runs have the same intervals: all resamples are drawn from one seed.

All intervals are of 95 % confidence.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from optiplan.arrays import Array

TAIL = 2.5
"""Percent of the bootstrap distribution on either side of an interval."""

RESAMPLES = 1000
"""Of a median."""
SHARE_RESAMPLES = 10_000
"""Of a share: its ends then move by a hundredth of its width from seed to seed."""
SEED = 0
"""Of the resamples."""
FEWEST = 5
"""Problems without which an interval is not given: so few say nothing about the others."""

ALPHA = 0.05
"""Probability by chance below which a difference counts, after Holm's correction."""
TIE = 0.01
"""Costs within 1 % of each other are the same."""

_BLOCK = 100_000  # numbers at a time: they stay in the processor's cache


class Interval(NamedTuple):
    """An estimate with its confidence interval; nan where there is none."""

    value: float
    low: float
    high: float

    @property
    def ends(self) -> tuple[float, float] | None:
        """The ends; None where there are none."""
        return None if math.isnan(self.low) else (self.low, self.high)


def share_intervals(verified: Array, tries: Array, seed: int = SEED) -> list[Interval]:
    """Success rates p = sum of successes / sum of tries, with percentile intervals of resampled problems.

    Runs of one problem are alike, so whole problems are drawn, with all their seeds and repetitions: ten seeds of a
    problem say little more than one. Among those drawn are always two that were made up, one solved and one not: an
    interval has a width where all problems are solved, too, and is rather too wide than too narrow for few of them.

    Args:
        verified: (m, s), successes of each problem and planner.
        tries: (m, s), runs likewise; a problem without runs of a planner does not count for it.
        seed: of the resamples, which are the same for all planners.

    Returns:
        s intervals; without ends for fewer than 5 problems.

    Source: Davison and Hinkley, Bootstrap Methods and their Application (1997), sec. 3.8; made-up trials: Agresti and
    Coull, The American Statistician 52 (1998) 119.
    """
    tried = tries > 0
    usual = tries.sum(axis=0) / np.maximum(tried.sum(axis=0), 1)
    successes, runs = np.vstack([verified, usual, 0.0 * usual]), np.vstack([tries, usual, usual])
    rates = _drawn_rates(successes, runs, np.random.default_rng(seed))
    found = []
    for k, count in enumerate(tried.sum(axis=0)):
        total = float(tries[:, k].sum())
        p = float(verified[:, k].sum()) / total if total else math.nan
        low, high = np.nanpercentile(rates[:, k], [TAIL, 100.0 - TAIL]) if count >= FEWEST else (math.nan, math.nan)
        found.append(Interval(p, float(min(low, p)), float(max(high, p))))
    return found


def _drawn_rates(successes: Array, runs: Array, rng: np.random.Generator) -> Array:
    """Rates (SHARE_RESAMPLES, s) of resamples of the rows of two arrays (m, s); nan where nothing was drawn."""
    count = len(runs)
    rows = max(1, _BLOCK // count)
    rates: list[Array] = []
    for begin in range(0, SHARE_RESAMPLES, rows):
        size = min(rows, SHARE_RESAMPLES - begin)
        times = rng.multinomial(count, np.full(count, 1.0 / count), size=size).astype(float)
        with np.errstate(invalid="ignore"):
            rates.append((times @ successes) / (times @ runs))
    return np.concatenate(rates)


def median_interval(values: Array, groups: npt.NDArray[np.int64] | None = None, seed: int = SEED) -> Interval:
    """Median of values (n,) with the percentile interval of its bootstrap distribution.

    Args:
        values: (n,), in any unit; finite.
        groups: (n,), which problem a value is of. Whole groups are drawn, as runs of one problem are alike and say
            less than as many of different problems. None: every value is one of its own.
        seed: of the resamples.

    Source: Efron and Tibshirani, An Introduction to the Bootstrap (1993), ch. 13; groups: Davison and Hinkley,
    Bootstrap Methods and their Application (1997), sec. 3.8.
    """
    if len(values) == 0:
        return Interval(math.nan, math.nan, math.nan)
    median = float(np.median(values))
    order = np.argsort(values)
    numbers = np.arange(len(values)) if groups is None else np.unique(groups, return_inverse=True)[1]
    count = int(numbers.max()) + 1
    if count < FEWEST:
        return Interval(median, math.nan, math.nan)
    rng = np.random.default_rng(seed)
    ordered = values[order]
    alone = count == len(values)
    drawn = _medians_of_values(ordered, rng) if alone else _medians_of_groups(ordered, numbers[order], rng)
    low, high = np.percentile(drawn, [TAIL, 100.0 - TAIL])
    return Interval(median, float(low), float(high))


def _medians_of_values(ordered: Array, rng: np.random.Generator) -> Array:
    """Medians of resamples of ordered values (n,).

    The k-th smallest of a resample is the value at rank floor(n U_(k)), U_(k) the k-th smallest of n uniform numbers,
    which has distribution Beta(k, n - k + 1): it is drawn at once instead of n ranks, to the same distribution. For
    even n the next one is U_(k) + (1 - U_(k)) (1 - V^(1 / (n - k))), the smallest of the n - k that are left.
    """
    n = len(ordered)
    k = (n + 1) // 2
    lower = rng.beta(k, n - k + 1, RESAMPLES)
    upper = lower if n % 2 else lower + (1.0 - lower) * (1.0 - rng.random(RESAMPLES) ** (1.0 / (n - k)))
    ranks = np.minimum((n * np.array([lower, upper])).astype(np.int64), n - 1)
    return np.asarray(0.5 * ordered[ranks].sum(axis=0))


def _medians_of_groups(ordered: Array, groups: npt.NDArray[np.int64], rng: np.random.Generator) -> Array:
    """Medians of resamples of whole groups; values (n,) in order, group numbers (n,) from 0."""
    count = int(groups.max()) + 1
    rows = max(1, min(RESAMPLES, _BLOCK // len(ordered)))
    medians: list[Array] = []
    for begin in range(0, RESAMPLES, rows):
        size = min(rows, RESAMPLES - begin)
        drawn = rng.integers(count, size=(size, count)) + count * np.arange(size)[:, None]
        times = np.bincount(drawn.ravel(), minlength=size * count).reshape(size, count)
        each = times.astype(np.int32)[:, groups]
        upto = np.cumsum(each, axis=1, dtype=np.int32)  # values at this rank or below, in each resample
        half = 0.5 * upto[:, -1:]
        ranks = np.array([np.argmax(upto >= half, axis=1), np.argmax(upto > half, axis=1)])
        medians.append(0.5 * ordered[ranks].sum(axis=0))
    return np.concatenate(medians)


def sign_test(wins: int, losses: int) -> float:
    """Return the two-sided probability of a split at least as uneven as wins to losses if both are equally likely.

    Ties do not count. It is the binomial test of min(w, l) among w + l with chance 1/2; 1 where nothing was compared.
    """
    from scipy.special import bdtr

    return min(1.0, 2.0 * float(bdtr(min(wins, losses), wins + losses, 0.5)))


def signed_rank_test(differences: Array) -> float:
    """Return the two-sided probability of Wilcoxon's signed-rank test of paired differences (n,) about zero.

    Zeros are left out, ties have their mean rank. Exact up to 50 pairs without ties and up to 13 with ties; else the
    normal approximation, corrected for ties.

    Source: Wilcoxon, Biometrics Bulletin 1 (1945) 80; `scipy.stats.wilcoxon`.
    """
    from scipy.stats import wilcoxon

    nonzero = differences[differences != 0.0]
    return float(wilcoxon(nonzero).pvalue) if len(nonzero) else 1.0


def holm(p: Sequence[float]) -> list[float]:
    """Probabilities corrected for the number of tests: max over j <= i of min(1, (m - j + 1) p_(j)), p_(j) ascending.

    Rejecting those below alpha errs anywhere with probability at most alpha, whatever depends on what.

    Source: Holm, Scandinavian Journal of Statistics 6 (1979) 65.
    """
    corrected = [0.0] * len(p)
    worst = 0.0
    for place, index in enumerate(sorted(range(len(p)), key=lambda i: p[i])):
        worst = max(worst, min(1.0, (len(p) - place) * p[index]))
        corrected[index] = worst
    return corrected


def median_of_known(values: Array) -> float:
    """Return the median of what is finite among values (n,); nan without any."""
    known = values[np.isfinite(values)]
    return float(np.median(known)) if len(known) else math.nan


def share_within(costs: Array, tries: int) -> tuple[Array, Array]:
    """Steps of the share of all tries that cost at most x: x ascending (m,), share after each (m,).

    Args:
        costs: (k,), in any unit, of the tries that succeeded; what is not finite counts as a failure, at any x.
        tries: all, failures included.
    """
    x = np.sort(costs[np.isfinite(costs)])
    return x, np.arange(1, len(x) + 1) / max(tries, 1)


def performance_ratios(costs: Array) -> Array:
    """Cost of each solver relative to the best one's on the same problem, (problems, solvers).

    r_ps = c_ps / min over s of c_ps, inf where solver s failed. The share of *all* problems with r_ps <= tau, over tau,
    is the performance profile: at 1 how often a solver is best, at the right how often it succeeds.

    Args:
        costs: (problems, solvers), positive; what is not finite is a failure.

    Source: Dolan and More, Mathematical Programming 91 (2002) 201.
    """
    finite = np.where(np.isfinite(costs), costs, np.inf)
    best = finite.min(axis=1, keepdims=True)
    return np.asarray(np.where(np.isfinite(finite), finite / np.where(np.isfinite(best), best, 1.0), np.inf))
