"""Orders of tours that OR-Tools finds keep to what is stated."""

import numpy as np
import pinocchio as pin
import pytest

from optiplan.planners.tours.order import OrderSearch
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
