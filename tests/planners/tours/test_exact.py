"""The best of few targets is the best of all orders and configurations; the search of many comes near."""

import numpy as np
import pytest

from optiplan.planners.tours.exact import best_tour, work_of
from optiplan.planners.tours.order import OrderSearch
from tests.planners.tours.layers import best_of_all, ladder_of, random_layers, seconds_of

CASES = {
    "free": ({name: {} for name in "abcd"}, {}),
    "closed": ({name: {} for name in "abcd"}, {"closed": True}),
    "after": ({"a": {"after": ("d",)}, "b": {}, "c": {"after": ("a",)}, "d": {}}, {"closed": True}),
    "ends": ({name: {} for name in "abcd"}, {"first": "c", "last": "a"}),
    "clusters": ({n: {"cluster": "x" if n in "ac" else "y"} for n in "abcd"}, {}),
    "windows": ({"a": {"window": (0.0, 2.5)}, "b": {"window": (6.0, 20.0)}, "c": {}, "d": {}}, {"closed": True}),
}


@pytest.mark.parametrize("name", CASES)
def test_the_best_of_all_orders(name):
    ladder = ladder_of(CASES[name][0], **CASES[name][1])
    layers = random_layers(4, 2, 1)
    best = best_of_all(ladder, layers)
    found = best_tour(ladder, layers)
    assert found.seconds == pytest.approx(best, rel=1e-12)
    assert seconds_of(ladder, found.order, found.Q) == pytest.approx(best, rel=1e-12)
    again = ladder.cheapest(layers, found.order)
    assert again.seconds == pytest.approx(best, rel=1e-12)
    assert again.numbers == found.numbers
    order = OrderSearch(ladder.tour).improved(ladder.between_targets(found), None, 30, 2.0)
    assert ladder.cheapest(layers, order).seconds == pytest.approx(best, rel=0.02)


def test_no_tour_where_no_order_is_in_time():
    ladder = ladder_of({"a": {"window": (0.0, 0.1)}, "b": {}})
    layers = random_layers(2, 2, 1)
    assert best_tour(ladder, layers) is None
    assert not np.isfinite(ladder.cheapest(layers, (0, 1)).seconds)


def test_legs_that_are_known_count_as_they_are():
    ladder = ladder_of({"a": {}, "b": {}})
    layers = random_layers(2, 2, 2)
    straight = ladder.cheapest(layers, (0, 1))
    for i in layers[0].numbers:
        for j in layers[1].numbers:
            ladder.known.set((0, 1), (int(i), int(j)), np.inf)
    assert not np.isfinite(ladder.cheapest(layers, (0, 1)).seconds)
    assert best_tour(ladder, layers).order == (1, 0)
    ladder.known.set((0, 1), straight.numbers, 100.0)
    assert 100.0 < ladder.cheapest(layers, (0, 1)).seconds < 110.0
    assert ladder.between_targets(straight)[1, 2] == 100.0
    assert (ladder.relaxed(layers, straight) <= ladder.times.between(straight.Q, straight.Q)[0, 1] + 100.0).all()


def test_the_work_of_thousands_of_targets_is_a_number():
    assert work_of(random_layers(4, 3, 1)) == 4.0 * 12**2
    assert work_of(random_layers(2000, 1, 1)) > 1e200
