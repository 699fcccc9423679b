"""When is another attempt worth its time: the formula of `Patience` by hand, and what it means for a budget."""

from dataclasses import replace
from math import inf
from types import SimpleNamespace

import numpy as np
import pytest

from optiplan.planners.base import Budget
from optiplan.planners.sampling.search import Search
from optiplan.planners.trajopt.stopping_rule import PRICE, SAME, SHORTCUT, STATE, STEP, Patience, counted


def after(costs: list[float | None], seconds: float, budget: float = 10.0, good_enough: float = 1.0) -> Patience:
    """Patience after attempts that cost so much (None: not free) and took `seconds` each."""
    patience = Patience(Budget(budget), good_enough)
    for cost in costs:
        patience.seconds += seconds
        patience.record(cost)
    return patience


def longest(costs: list[float | None], bound: float, budget: float = 10.0) -> float:
    """Seconds an attempt may take on average so that one more is worth making, found by halving."""
    low, high = 0.0, 1e6
    best = min(cost for cost in costs if cost is not None)
    for _ in range(200):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if after(costs, middle, budget).worth_another(best, bound) else (low, middle)
    return low


@pytest.mark.parametrize(
    ("costs", "bound", "gain"),
    [
        # The spread: (c_2 - c_1) / n (1 + k) as a share of c_1. The bound is as good as reached: it counts for nothing.
        ([1.0, 1.2], 1.0 - 1e-9, 0.2 / 2 / 2),
        ([1.5, 1.0, 1.3, 1.9], 1.0 - 1e-9, 0.3 / 4 / 3),
        ([2.0, None, 3.0], 2.0 - 1e-9, 0.5 / 3 / 3),
        # The bound: g² / n r (1 + k).
        ([1.0], 0.8, 0.2**2),
        ([1.0, 1.0], 0.8, 0.2**2 / 2 / 2 / 2),
        ([1.0, 1.004, 1.0], 0.7, 0.3**2 / 3 / 3 / 3),
        ([1.0, None], 0.5, 0.5**2 / 2 / 2),
        # The larger of the two: here the spread, although the bound is far.
        ([1.0, 1.5], 0.9, 0.5 / 2 / 2),
        ([1.0, 1.001], 0.5, 0.5**2 / 2 / 2 / 2),
    ],
)
@pytest.mark.parametrize("budget", [2.0, 20.0])
def test_the_rule_of_the_docstring_by_hand(costs: list[float | None], bound: float, gain: float, budget: float) -> None:
    """One more is worth making while gain / (seconds an attempt) > PRICE / budget."""
    assert longest(costs, bound, budget) == pytest.approx(gain * budget / PRICE, rel=1e-9)


def test_local_optima_found_again_end_the_search() -> None:
    """The same optimum again and again says that there is no other: each time less is expected."""
    allowed = [longest([1.0] * count, bound=0.8) for count in (1, 2, 4, 8)]
    assert allowed == sorted(allowed, reverse=True)
    assert allowed[3] < allowed[0] / 50.0  # 1 / n, 1 / r and 1 / (1 + k): 1 / 512
    apart = longest([1.0, 1.0 * SAME * 1.001], bound=0.8)
    again = longest([1.0, 1.0 * SAME * 0.999], bound=0.8)
    assert apart == pytest.approx(2.0 * again, rel=1e-6)


def test_a_larger_budget_searches_longer() -> None:
    costs, bound = [1.0, 1.02, 1.0], 0.9
    enough = longest(costs, bound, budget=1.0)
    assert longest(costs, bound, budget=60.0) == pytest.approx(60.0 * enough)
    assert not after(costs, 2.0 * enough, budget=1.0).worth_another(1.0, bound)
    assert after(costs, 2.0 * enough, budget=60.0).worth_another(1.0, bound)


def test_nothing_is_sought_below_what_is_good_enough() -> None:
    assert after([], 0.0).worth_another(1.01, 1.0), "without an attempt there is nothing to judge by"
    assert not after([], 0.0, good_enough=1.01).worth_another(1.01, 1.0)
    assert not after([1.0, 2.0], 1e-6, good_enough=1.0).worth_another(1.0, 1.0)
    assert after([1.0, 2.0], 1e-6, good_enough=1.0).worth_another(1.0, 0.999)


def test_a_bound_above_the_best_is_no_reason_to_go_on() -> None:
    """A motion to a nearer end may be below the bound of another end."""
    assert not after([1.0, 1.0], 0.1).worth_another(1.0, 1.5)


def test_work_is_counted_in_steps_and_shortcuts_not_by_a_clock() -> None:
    patience = Patience(Budget(10.0))
    patience.work(steps=30)
    patience.work(shortcuts=20)
    assert patience.seconds == pytest.approx(30 * STEP + 20 * SHORTCUT)


def test_attempts_in_vain_end_the_search_and_a_gain_begins_it_anew() -> None:
    """Every one in a row that brings nothing makes a further one less likely to bring anything, free or not."""
    worth = [after([1.0, *[None] * failed], 0.1).worth(1.0, 0.8) + 0.1 * (1 + failed) for failed in range(4)]
    assert worth == pytest.approx([0.2**2 * 10.0 / PRICE / (1 + failed) for failed in range(4)])
    assert after([1.2, 1.3, 1.4, 1.0], 0.1).in_vain == 0
    assert after([1.2, 1.3, 1.4, 1.2 / SAME * 1.001], 0.1).in_vain == 3, "next to nothing is no gain"
    assert after([None, None], 0.1).in_vain == 2


def test_what_a_search_may_take_is_counted_and_ends_it_for_good() -> None:
    asked = []

    def fruitless(check: object, ends: object, budget: object, seed: int, *, patience: float) -> Search:
        asked.append(patience)
        return Search(None, np.zeros((1, 2)), np.zeros((1, 2)), (3, 4), impatient=True)

    patience, nothing = Patience(Budget(10.0)), SimpleNamespace()
    search = counted(fruitless, patience, 1500 * STATE)
    wishes = (600.0, 700.0, 800.0)
    first, second, third = (search(nothing, nothing, nothing, 0, patience=wish) for wish in wishes)  # type: ignore[arg-type]
    assert asked == pytest.approx([600.0, 700.0, 200.0])
    assert (first.impatient, second.impatient, third.impatient) == (True, True, False)
    assert patience.seconds == pytest.approx(1500 * STATE)


def test_a_search_that_finds_a_path_counts_its_states() -> None:
    found = Search(np.zeros((2, 2)), np.zeros((1, 2)), np.zeros((1, 2)), (30, 40))
    patience, nothing = Patience(Budget(10.0)), SimpleNamespace()
    search = counted(lambda *arguments, patience: replace(found), patience, inf)
    assert search(nothing, nothing, nothing, 0, patience=1e3).path is found.path  # type: ignore[arg-type]
    assert patience.seconds == pytest.approx(70 * STATE)
