"""Against published numbers, SciPy, and the plain way of doing it."""

import math

import numpy as np
import pytest

from optiplan.bench.statistics import intervals_and_tests
from optiplan.bench.statistics.intervals_and_tests import (
    holm,
    median_interval,
    performance_ratios,
    share_intervals,
    share_within,
    sign_test,
    signed_rank_test,
)


def wilson(k, n, z=1.959963984540054):
    """Wilson's interval of k in n independent tries: what shares had before problems were resampled."""
    middle, spread = k / n + z**2 / (2 * n), z * math.sqrt(k / n * (1 - k / n) / n + z**2 / (4 * n**2))
    return (middle - spread) / (1 + z**2 / n), (middle + spread) / (1 + z**2 / n)


@pytest.mark.parametrize(("mean", "alike"), [(0.5, 0.2), (0.8, 0.3), (0.9, 2.0)])
def test_intervals_of_shares_cover_the_truth_where_runs_of_a_problem_are_alike(mean, alike, monkeypatch):
    """Problems of which most are always solved or never: 40 of them, 15 runs each, 400 experiments."""
    monkeypatch.setattr(intervals_and_tests, "SHARE_RESAMPLES", 1000)
    rng = np.random.default_rng(1)
    verified = rng.binomial(15, rng.beta(mean * alike, (1.0 - mean) * alike, (40, 400))).astype(float)
    ours = share_intervals(verified, np.full((40, 400), 15.0))
    independent = [wilson(solved, 600) for solved in verified.sum(axis=0)]
    assert 0.93 <= np.mean([one.low <= mean <= one.high for one in ours]) <= 0.99
    assert np.mean([low <= mean <= high for low, high in independent]) < 0.70


def test_the_ends_of_a_share_s_interval_hardly_depend_on_the_seed():
    verified = np.random.default_rng(0).integers(0, 6, (60, 2)).astype(float)
    ends = np.array([[one[1:] for one in share_intervals(verified, np.full((60, 2), 5.0), seed)] for seed in range(8)])
    width = np.diff(ends.mean(axis=0), axis=1)
    assert (np.ptp(ends, axis=0) < 0.05 * width).all()


def test_shares_at_the_ends_and_of_few_problems():
    tries = np.array([[5.0, 5.0, 5.0]] * 10)
    tries[4:, 2] = 0.0
    all_, none, few = share_intervals(tries * [1, 0, 1], tries)
    assert (all_.value, all_.high, none.value, none.low) == (1.0, 1.0, 0.0, 0.0)
    assert 0.6 < all_.low < 0.9
    assert none.high == pytest.approx(1.0 - all_.low, abs=0.05)
    assert few.value == 1.0
    assert math.isnan(few.low)
    assert math.isnan(share_intervals(np.zeros((6, 1)), np.zeros((6, 1)))[0].value)


def test_seeds_of_a_problem_add_nothing_to_what_is_known_of_problems():
    verified = (np.arange(30) < 20).astype(float)[:, None]
    once, often = (share_intervals(n * verified, np.full((30, 1), n))[0] for n in (1.0, 20.0))
    assert often == pytest.approx(once, abs=1e-9)


@pytest.mark.parametrize("n", [8, 9, 40, 41])
def test_medians_drawn_at_once_are_distributed_as_those_of_resamples(n, monkeypatch):
    from scipy import stats  # half a second of each worker where it collects tests

    monkeypatch.setattr(intervals_and_tests, "RESAMPLES", 20_000)
    rng = np.random.default_rng(n)
    values = np.sort(rng.lognormal(size=n))
    plain = np.median(rng.choice(values, size=(20_000, n)), axis=1)
    quick = intervals_and_tests._medians_of_values(values, rng)
    grouped = intervals_and_tests._medians_of_groups(values, np.arange(n), rng)
    for drawn in (quick, grouped):
        assert stats.ks_2samp(drawn, plain).statistic < 0.02


def test_median_interval_of_known_values():
    # of 1 .. 99: ranks of the median within 1.96 sqrt(n) / 2 of the middle, 50 -+ 9.75
    found = median_interval(np.arange(1.0, 100.0))
    assert found.value == 50.0
    assert found[1:] == pytest.approx((40.25, 59.75), abs=1.3)
    assert found == median_interval(np.arange(99.0, 0.0, -1.0))
    assert found != median_interval(np.arange(1.0, 100.0), seed=1)


def test_runs_of_one_problem_do_not_count_as_many():
    values = np.random.default_rng(0).lognormal(size=30)
    alone = median_interval(values)
    repeated = median_interval(np.repeat(values, 20), np.repeat(np.arange(30), 20))
    wrong = median_interval(np.repeat(values, 20))
    assert repeated.value == alone.value
    assert repeated[1:] == pytest.approx(alone[1:], rel=0.15)
    assert wrong.high - wrong.low < 0.4 * (alone.high - alone.low)


def test_median_of_few_has_no_interval():
    assert median_interval(np.array([3.0, 1.0, 2.0])).value == 2.0
    assert math.isnan(median_interval(np.array([3.0, 1.0, 2.0])).low)
    assert math.isnan(median_interval(np.arange(50.0), np.arange(50) % 3).low)
    assert all(map(math.isnan, median_interval(np.empty(0))))


@pytest.mark.parametrize(("wins", "losses"), [(0, 0), (5, 0), (0, 1), (3, 9), (50, 50), (50, 51), (700, 600)])
def test_sign_test_sums_binomial_probabilities(wins, losses):
    n = wins + losses
    expected = min(1.0, 2 * sum(math.comb(n, k) for k in range(min(wins, losses) + 1)) / 2**n)
    assert sign_test(wins, losses) == pytest.approx(expected, rel=1e-9)


def ranks_of(d):
    """Ranks of sizes, by their mean where these are alike."""
    sizes = np.abs(d)
    return np.array([(sizes < one).sum() + 0.5 * ((sizes == one).sum() + 1) for one in sizes])


def counted(d):
    """Share of all sign patterns whose rank sum is as far from its mean, of integer doubled ranks."""
    doubled = (2 * ranks_of(d)).astype(int)
    total, found = doubled.sum(), doubled[d > 0.0].sum()
    ways = [1] + [0] * total
    for rank in doubled:
        ways = [w + (ways[k - rank] if k >= rank else 0) for k, w in enumerate(ways)]
    return min(1.0, 2 * sum(ways[: min(found, total - found) + 1]) / 2 ** len(d))


def normal(d):
    """Normal approximation with the variance corrected for ties."""
    n, ranks = len(d), ranks_of(d)
    _, ties = np.unique(np.abs(d), return_counts=True)
    variance = (n * (n + 1) * (2 * n + 1) - (ties.astype(float) ** 3 - ties).sum() / 2.0) / 24.0
    return math.erfc(abs(ranks[d > 0.0].sum() - n * (n + 1) / 4.0) / math.sqrt(2.0 * variance))


@pytest.mark.parametrize("n", [3, 12, 50, 51, 400])
def test_signed_rank_test_is_exact_up_to_50_pairs(n):
    d = np.random.default_rng(n).normal(0.15, 1.0, n)
    assert signed_rank_test(d) == pytest.approx((counted if n <= 50 else normal)(d), rel=1e-9)


def test_signed_rank_test_with_ties():
    few = np.array([1.0, 1.0, -1.0, 2.0, 2.0, 3.0, 0.0])
    assert signed_rank_test(few) == pytest.approx(counted(few[:-1]), rel=1e-9)
    for count in (40, 300):
        many = np.round(np.random.default_rng(0).normal(0.1, 2.0, count))
        assert signed_rank_test(many) == pytest.approx(normal(many[many != 0.0]), rel=1e-9)
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
