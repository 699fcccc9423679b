"""Against published numbers, SciPy, and the plain way of doing it."""

import math

import numpy as np
import pytest
from scipy import stats

from optiplan.bench import statistics
from optiplan.bench.statistics import (
    holm,
    median_interval,
    performance_ratios,
    share_within,
    sign_test,
    signed_rank_test,
    wilson,
)

NEWCOMBE = {(81, 263): (0.2553, 0.3662), (15, 148): (0.0624, 0.1605), (0, 20): (0.0, 0.1611), (1, 29): (0.0061, 0.1718)}
"""Table I of Newcombe (1998), method 3."""


@pytest.mark.parametrize(("k", "n"), NEWCOMBE)
def test_wilson_against_the_published_table(k, n):
    found = wilson(k, n)
    assert found[1:] == pytest.approx(NEWCOMBE[k, n], abs=5e-5)
    assert found.value == k / n


def test_wilson_at_the_ends():
    assert wilson(10, 10)[1:] == (pytest.approx(1.0 / (1.0 + statistics.Z**2 / 10)), 1.0)
    assert wilson(0, 10).low == 0.0
    assert wilson(0, 0)[1:] == (0.0, 1.0)


@pytest.mark.parametrize("n", [8, 9, 40, 41])
def test_medians_drawn_at_once_are_distributed_as_those_of_resamples(n, monkeypatch):
    monkeypatch.setattr(statistics, "RESAMPLES", 20_000)
    rng = np.random.default_rng(n)
    values = np.sort(rng.lognormal(size=n))
    plain = np.median(rng.choice(values, size=(20_000, n)), axis=1)
    quick = statistics._medians_of_values(values, rng)
    grouped = statistics._medians_of_groups(values, np.arange(n), rng)
    for drawn in (quick, grouped):
        assert stats.ks_2samp(drawn, plain).statistic < 0.02


def test_median_interval_of_known_values():
    # of 1 .. 99: ranks of the median within 1.96 sqrt(n) / 2 of the middle, 50 -+ 9.75
    found = median_interval(np.arange(1.0, 100.0), seed=0)
    assert found.value == 50.0
    assert found[1:] == pytest.approx((40.25, 59.75), abs=1.3)
    assert found == median_interval(np.arange(99.0, 0.0, -1.0), seed=0)
    assert found != median_interval(np.arange(1.0, 100.0), seed=1)


def test_runs_of_one_problem_do_not_count_as_many():
    values = np.random.default_rng(0).lognormal(size=30)
    alone = median_interval(values, 0)
    repeated = median_interval(np.repeat(values, 20), 0, np.repeat(np.arange(30), 20))
    wrong = median_interval(np.repeat(values, 20), 0)
    assert repeated.value == alone.value
    assert repeated[1:] == pytest.approx(alone[1:], rel=0.15)
    assert wrong.high - wrong.low < 0.4 * (alone.high - alone.low)


def test_median_of_few_has_no_interval():
    assert median_interval(np.array([3.0, 1.0, 2.0]), 0).value == 2.0
    assert math.isnan(median_interval(np.array([3.0, 1.0, 2.0]), 0).low)
    assert math.isnan(median_interval(np.arange(50.0), 0, np.arange(50) % 3).low)
    assert all(map(math.isnan, median_interval(np.empty(0), 0)))


@pytest.mark.parametrize(("wins", "losses"), [(0, 0), (5, 0), (3, 9), (50, 50), (700, 600)])
def test_sign_test(wins, losses):
    expected = 1.0 if wins + losses == 0 else stats.binomtest(wins, wins + losses).pvalue
    assert sign_test(wins, losses) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("n", [3, 12, 50, 51, 400])
def test_signed_rank_test_against_scipy(n):
    d = np.random.default_rng(n).normal(0.15, 1.0, n)
    way = "exact" if n <= statistics.EXACT else "approx"
    assert signed_rank_test(d) == pytest.approx(stats.wilcoxon(d, method=way).pvalue, rel=1e-9)


def test_signed_rank_test_with_ties_counts_all_signs():
    d = np.array([1.0, 1.0, -1.0, 2.0, 2.0, 3.0, 0.0])
    ranks = stats.rankdata(np.abs(d[:-1]))
    sums = [sum(r for k, r in enumerate(ranks) if bits >> k & 1) for bits in range(64)]
    mean, found = ranks.sum() / 2, ranks[d[:-1] > 0].sum()
    assert signed_rank_test(d) == sum(abs(s - mean) >= abs(found - mean) for s in sums) / 64
    many = np.round(np.random.default_rng(0).normal(0.1, 2.0, 300))
    expected = stats.wilcoxon(many, zero_method="wilcox", method="approx").pvalue
    assert signed_rank_test(many) == pytest.approx(expected, rel=1e-9)
    assert signed_rank_test(np.zeros(4)) == 1.0


def test_holm_against_a_worked_example():
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert holm([0.9, 0.8]) == [1.0, 1.0]
    assert holm([]) == []


def test_failures_never_count_as_times():
    x, share = share_within(np.array([2.0, np.nan, 1.0, np.inf]), 4)
    assert x.tolist() == [1.0, 2.0]
    assert share.tolist() == [0.25, 0.5]


def test_performance_ratios():
    costs = np.array([[1.0, 2.0], [np.nan, 3.0], [np.nan, np.inf], [4.0, 1.0]])
    expected = [[1.0, 2.0], [np.inf, 1.0], [np.inf, np.inf], [4.0, 1.0]]
    assert performance_ratios(costs).tolist() == expected
