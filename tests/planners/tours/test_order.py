"""Orders of tours that OR-Tools finds keep to what is stated."""

from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from optiplan.planners.tours.order import OrderSearch
from optiplan.planners.tours.order_rules import OrderRules
from optiplan.problem.regions.region import RegionGoal
from optiplan.problem.task.steps import Target, TargetTour

GOAL = RegionGoal("tool", pin.SE3.Identity(), pin.SE3.Identity(), np.zeros(6), np.zeros(6))


@pytest.mark.parametrize("moment", [3.0, 10.0 / 3.0])
def test_a_window_of_no_width_is_kept_to_a_microsecond(moment):
    pytest.importorskip("ortools")
    windows = [(0.0, np.inf), (moment, moment), (0.0, np.inf), (0.0, np.inf)]
    tour = TargetTour((), tuple(Target(f"t{k}", GOAL, window=window) for k, window in enumerate(windows)))
    order = OrderSearch(tour).improved(np.ones((5, 5)) - np.eye(5), None, 0, 5.0)
    assert order is not None
    assert order.index(1) <= 2


@pytest.mark.parametrize("stated", ["first", "after", "chain", "cluster", "window"])
@pytest.mark.parametrize("count", [10, 40])
def test_a_first_order_is_found_where_targets_come_before_others(count, stated):
    """The library makes none by itself: it goes on to the nearest target, and never comes back to that."""
    pytest.importorskip("ortools")
    wanted = [dict[str, Any]() for _ in range(count)]
    for k in range(3, count, 3):
        wanted[k] = {"after": (f"t{k - 3}" if stated == "chain" else "t2",)} if stated != "first" else {}
    if stated == "cluster":
        wanted = [{**one, "cluster": "abc"[k % 3]} for k, one in enumerate(wanted)]
    if stated == "window":
        wanted[2] = {"window": (0.0, 0.4 * count)}
    targets = tuple(Target(f"t{k}", GOAL, **one) for k, one in enumerate(wanted))
    tour = TargetTour((), targets, first="t0" if stated == "first" else "")
    places = np.random.default_rng(count).uniform(-1.0, 1.0, (count + 1, 2))
    order = OrderSearch(tour).improved(np.linalg.norm(places[:, None] - places[None], axis=2), None, 0, 2.0)
    assert order is not None
    assert OrderRules(tour).allow(order)
