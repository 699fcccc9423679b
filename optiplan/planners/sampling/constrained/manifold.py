"""Configurations that hold a problem's path constraints, and projection onto them."""

import numpy as np

from optiplan.arrays import Array
from optiplan.planners.path_constraints.inequalities import inequalities
from optiplan.planners.path_constraints.inequality import (
    KEPT,
    CompiledInequality,
    PairsApart,
    RowsAtRest,
    shortest_step,
    stepped,
)
from optiplan.problem.constraints.base import WHOLE
from optiplan.problem.constraints.motions import PairClearance
from optiplan.problem.problem import Problem

_ITERATIONS = 12
_AIMED = 1.5  # times the reserve: where projection aims, so that points between two of them hold too


class Manifold:
    """The set g(q) >= 0 of all constraints of positions; projection keeps a reserve r: g(q) >= r.

    Newton's method on the violated rows: d = J^T (J J^T + damping)^-1 (r - g), with the rows and exact slopes of
    `trajopt`. The clearance of a pair is checked, but not projected onto. The time law holds constraints of speed.

    Sources: Stilman, "Global manipulation planning in robot joint space with task constraints", T-RO 2010; Berenson
    et al., "Manipulation planning on constraint manifolds", ICRA 2009.
    """

    def __init__(self, problem: Problem, ends: Array) -> None:
        """Set the reserve to at most that of the ends (k, n), which hold the constraints."""
        robot, constraints = problem.robot, problem.path_constraints
        inside = [
            CompiledInequality(robot, stated)
            for one in constraints
            if not isinstance(one, PairClearance)
            for stated in inequalities(one)
            if not stated.rate
        ]
        self._apart = [PairsApart(problem, one) for one in constraints if isinstance(one, PairClearance)]
        self._limits, self._still = problem.limits, np.zeros((1, robot.n))
        self._rows = RowsAtRest(robot, inside)
        reserves = [np.full(one.size, one.stated.reserve) for one in inside]
        reserve = np.concatenate([np.zeros(0), *reserves])
        least = np.min([self._rows(q)[0] for q in ends], axis=0)
        self._reserve = np.clip(KEPT * least, 0.0, reserve)

    def holds(self, q: Array) -> bool:
        """Return whether q (n,) holds all constraints."""
        value, _ = self._rows(q)
        return bool((value >= -1e-9).all()) and self._far_apart(q)

    def project(self, q: Array) -> Array | None:
        """Return a configuration (n,) near q that holds limits, and constraints with reserve; None if not found."""
        for _ in range(_ITERATIONS):
            value, slopes = self._rows(q)
            off = value - self._reserve
            if (off >= 0.0).all():
                return q if self._far_apart(q) else None
            wrong = off < 0.0
            step = shortest_step(slopes[wrong], _AIMED * self._reserve[wrong] - value[wrong])
            q = stepped(q, step, self._limits)
        return None

    def _far_apart(self, q: Array) -> bool:
        motion = [q[None], self._still, self._still]
        return all(float(one.least(motion).min()) >= 0.0 for one in self._apart)


def in_part_only(problem: Problem) -> list[str]:
    """Return the constraints that hold in a part of the motion only: a path has no times."""
    return [one.KEY for one in problem.path_constraints if one.during != WHOLE]
