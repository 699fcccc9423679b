"""A robot's joint space for OMPL: states, validity of states and motions, path costs, projections."""

from math import hypot
from typing import Any

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.planners.sampling.edge_checker import MotionCheck
from optiplan.planners.sampling.shortcutting import TWO_NORM_SHARE
from optiplan.robot.robot import Limits

_CELL = 0.1  # m, edge of the cells in which tool positions are counted


Ends = tuple[Array, Array]
"""Start (n,) and goals (k, n) of a search, rad or m."""


def search_bounds(limits: Limits, ends: Ends) -> tuple[Array, Array]:
    """Return the search box (n,), (n,): the position limits; half a turn beyond the ends for a joint without bounds."""
    both = np.vstack(ends)
    return limits.range_about(both.min(axis=0), both.max(axis=0))


class SearchSpace:
    """Joint space scaled to x = q / units, by default in s at full speed, within `search_bounds`.

    Attributes:
        information: OMPL's space information: states and motions are proved free.
    """

    def __init__(self, check: MotionCheck, ends: Ends) -> None:
        from ompl import base

        self._robot, self._units, self._n = check.model.robot, check.units, len(ends[0])
        self._lower, self._upper = search_bounds(check.limits, ends)
        bounds = base.RealVectorBounds(self._n)
        for j in range(self._n):
            bounds.setLow(j, float(self._lower[j] / self._units[j]))
            bounds.setHigh(j, float(self._upper[j] / self._units[j]))
        self._space = base.RealVectorStateSpace(self._n)
        self._space.setBounds(bounds)
        self._check = check
        self.information: Any = self._information()

    def close(self) -> None:
        """Break the reference cycle with OMPL, which the garbage collector cannot see."""
        self.information = None

    def read(self, state: Any) -> Array:
        """Return the configuration (n,) of a state."""
        return np.array([state[j] for j in range(self._n)]) * self._units

    def _valid(self, state: Any) -> bool:
        return not self._check.blocked(self.read(state))

    def _motion_valid(self, a: Any, b: Any) -> bool:
        return self._check.free(self.read(a), self.read(b))

    def _information(self) -> Any:
        from ompl import base

        information, free = base.SpaceInformation(self._space), self._motion_valid
        information.setStateValidityChecker(self._valid)

        class Validator(base.MotionValidator):  # type: ignore[misc]  # ompl has no types
            def checkMotion(self, a: Any, b: Any) -> bool:
                return free(a, b)

        information.setMotionValidator(Validator(information))
        information.setup()
        return information

    def problem(self, roots: Array, targets: Array) -> Any:
        """Return OMPL's problem definition: from any of the roots (r, n) to any of the targets (k, n)."""
        from ompl import base

        problem, goals = base.ProblemDefinition(self.information), base.GoalStates(self.information)
        for q in roots:
            problem.addStartState(self._state(q))
        for q in targets:
            goals.addState(self._state(q))
        problem.setGoal(goals)
        return problem

    def _state(self, q: Array) -> Any:
        state = self.information.allocState()
        for j, x in enumerate(np.clip(q, self._lower, self._upper) / self._units):
            state[j] = float(x)
        return state

    def path_time(self) -> Any:
        """Objective: sum over segments of max_j |dq_j / v_j| + 0.1 ||dq / v||, as `shortcutting.path_time` has it."""
        from ompl import base

        seconds = (self._units / self._check.limits.velocity).tolist()

        class PathTime(base.OptimizationObjective):  # type: ignore[misc]  # ompl has no types
            def stateCost(self, state: Any) -> Any:
                return base.Cost(0.0)

            def motionCost(self, a: Any, b: Any) -> Any:
                d = [(a[j] - b[j]) * s for j, s in enumerate(seconds)]
                return base.Cost(max(max(d), -min(d)) + TWO_NORM_SHARE * hypot(*d))

            def motionCostHeuristic(self, a: Any, b: Any) -> Any:
                return self.motionCost(a, b)  # a norm: nothing is shorter than the straight line

        return PathTime(self.information)

    def path_length(self) -> Any:
        """Return the objective sum over segments of ||dx||, for which OMPL samples the informed ellipsoid."""
        from ompl import base

        return base.PathLengthOptimizationObjective(self.information)

    def tool_cells(self) -> Any:
        """Return the projection of states to the tool's position, m: coverage is counted in cells of 0.1 m."""
        from ompl import base

        model, read, lift = self._robot.model, self.read, self._check.lift
        data, frame = model.createData(), model.getFrameId(self._robot.tool_frame)

        class ToolPosition(base.ProjectionEvaluator):  # type: ignore[misc]  # ompl has no types
            def getDimension(self) -> int:
                return 3

            def project(self, state: Any, projection: Array) -> None:
                pin.forwardKinematics(model, data, lift(read(state)))
                projection[:] = pin.updateFramePlacement(model, data, frame).translation

        cells = ToolPosition(self._space)
        for axis in range(3):
            cells.setCellSizes(axis, _CELL)
        return cells
