"""The order of many targets by OR-Tools: local search over orders that keep to what a tour states.

Source: Perron and Furnon, OR-Tools' routing library; guided local search after Voudouris and Tsang, 1999.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from optiplan.arrays import Array, Flags
from optiplan.errors import OptiPlanError
from optiplan.libraries import loading
from optiplan.problem.task.steps import TargetTour
from optiplan.problem.task.tour_order import implied, precedence

_UNIT = 1e6
"""Whole numbers of the library in a second."""

_LONGEST = 1e6
"""s, of any tour."""


class OrderSearch:
    """Search of orders for one tour; the times between targets change from call to call.

    Raises:
        OptiPlanError: OR-Tools is not installed.
    """

    def __init__(self, tour: TargetTour) -> None:
        with loading():
            try:
                from ortools.constraint_solver import pywrapcp, routing_enums_pb2
            except ImportError:
                message = "a tour with a free order of many targets needs OR-Tools: pip install 'optiplan[tours]'"
                raise OptiPlanError(message) from None
        self._lib, self._enums = pywrapcp, routing_enums_pb2
        self._tour = tour
        self._before = _without_implied(precedence(tour))

    def improved(self, seconds: Array, order: Sequence[int] | None, rounds: int, most: float) -> list[int] | None:
        """Return a better order by local search, None where none was found that is as stated.

        Args:
            seconds: (m + 1, m + 1) between the start (0) and the targets (1 + i), s.
            order: to begin with; None: one that is made here where targets come before others, else by the library.
            rounds: solutions after which guided local search ends; 0: the local search alone.
            most: s, of wall time.
        """
        m = len(self._tour.targets)
        manager = self._lib.RoutingIndexManager(m + 2, 1, [0], [m + 1])
        routing = self._lib.RoutingModel(manager)
        matrix = self._matrix(seconds)
        routing.SetArcCostEvaluatorOfAllVehicles(routing.RegisterTransitMatrix(matrix.tolist()))
        self._state(routing, manager, seconds)
        parameters = self._lib.DefaultRoutingSearchParameters()
        parameters.first_solution_strategy = self._enums.FirstSolutionStrategy.PATH_CHEAPEST_ARC
        if rounds:
            parameters.local_search_metaheuristic = self._enums.LocalSearchMetaheuristic.GUIDED_LOCAL_SEARCH
            parameters.solution_limit = rounds
        parameters.time_limit.FromMilliseconds(max(1, int(1e3 * most)))
        guesses = self._guesses(seconds) if order is None else [list(order)]
        routing.CloseModelWithParameters(parameters)
        read = (routing.ReadAssignmentFromRoutes([[1 + target for target in guess]], True) for guess in guesses)
        first = next((one for one in read if one is not None), None)
        if first is not None:
            found = routing.SolveFromAssignmentWithParameters(first, parameters)
        else:
            found = routing.SolveWithParameters(parameters) if order is None else None
        if found is None:
            return None
        way, index = [], found.Value(routing.NextVar(routing.Start(0)))
        while not routing.IsEnd(index):
            way.append(manager.IndexToNode(index) - 1)
            index = found.Value(routing.NextVar(index))
        return way

    def _guesses(self, seconds: Array) -> list[list[int]]:
        """Return first orders that keep to the precedence; the library finds none.

        One goes on to the nearest target that may come next, one to that whose window ends first.
        """
        if not self._before.any():
            return []
        ends = np.array([target.window[1] for target in self._tour.targets])
        urgencies = [np.zeros(len(ends)), *([ends] if np.isfinite(ends).any() else [])]
        return [self._greedy(seconds, urgency) for urgency in urgencies]

    def _greedy(self, seconds: Array, urgency: Array) -> list[int]:
        """Return the order that goes on to the most urgent target that may come next, the nearest of several such."""
        clusters = [target.cluster for target in self._tour.targets]
        waits, left, order = self._before.sum(axis=0), np.ones(len(clusters), dtype=bool), list[int]()
        while left.any():
            ready = np.flatnonzero(left & (waits == 0)).tolist()
            last = -1 if not order else order[-1]
            own = [k for k in ready if order and clusters[last] and clusters[k] == clusters[last]]
            target = min(own or ready, key=lambda k: (urgency[k], seconds[1 + last, 1 + k]))
            left[target] = False
            waits = waits - self._before[target]
            order.append(target)
        return order

    def _matrix(self, seconds: Array) -> Array:
        """Return costs (m + 2, m + 2): start, targets, end; leaving a cluster costs more than all legs together."""
        m = len(self._tour.targets)
        whole = np.zeros((m + 2, m + 2))
        whole[: m + 1, : m + 1] = np.minimum(seconds, _LONGEST / (m + 2))
        whole[1 : m + 1, m + 1] = whole[1 : m + 1, 0] if self._tour.closed else 0.0
        clusters = [target.cluster for target in self._tour.targets]
        if any(clusters):
            penalty = float(whole.sum(axis=1).max()) + 1.0
            numbers = {name: k for k, name in enumerate(dict.fromkeys(name for name in clusters if name))}
            own = np.array([-1, *(numbers.get(name, -1) for name in clusters), -1])
            whole += penalty * ((own[:, None] != own[None, :]) & (own[:, None] >= 0))
        return np.asarray(np.round(whole * _UNIT).astype(np.int64))

    def _state(self, routing: Any, manager: Any, seconds: Array) -> None:
        """State precedence and windows; leaving a target takes what is done there."""
        windows = [target.window for target in self._tour.targets]
        timed = any(low > 0.0 or np.isfinite(high) for low, high in windows)
        if not self._before.any() and not timed:
            return
        m = len(windows)
        travel = np.zeros((m + 2, m + 2))
        travel[: m + 1, : m + 1] = np.minimum(seconds, _LONGEST / (m + 2))
        travel[1 : m + 1] += self._tour.dwelling
        transit = routing.RegisterTransitMatrix(np.ceil(travel * _UNIT).astype(np.int64).tolist())
        horizon = int(_LONGEST * _UNIT)
        routing.AddDimension(transit, horizon if timed else 0, horizon, True, "time")
        time = routing.GetDimensionOrDie("time")
        for k, (low, high) in enumerate(windows):
            index = manager.NodeToIndex(1 + k)
            earliest = int(np.ceil(low * _UNIT))
            time.CumulVar(index).SetRange(earliest, max(earliest, int(min(high, _LONGEST) * _UNIT)))
        for i, j in zip(*np.nonzero(self._before), strict=True):
            first, second = (time.CumulVar(manager.NodeToIndex(1 + int(k))) for k in (i, j))
            routing.solver().Add(first <= second)
        if timed:
            time.SetSpanCostCoefficientForAllVehicles(1)


def _without_implied(before: Flags) -> Flags:
    """Return a precedence relation (m, m) without the pairs that others imply."""
    return before & ~implied(before) if before.any() else before
