"""Vias: the best of the motion that stops at each of them and those that pass them on rounded straight lines."""

from collections import Counter
from typing import Any

import numpy as np

from optiplan.libraries import clock
from optiplan.planners.base import Budget, Candidate, Failure, Planner, PlanResult, Progress
from optiplan.planners.common.via_legs import leg_by_leg
from optiplan.planners.vias.rounded import Rounded, RoundedOptions
from optiplan.problem.constraints.statements import WHOLE
from optiplan.problem.problem import Problem

_LEGS = 0.5
"""Share of the budget for the motion that stops at each via."""

_CORNERS = [
    corners
    for deviation in (0.05, 0.1, 0.2, 0.4)
    for corners in (RoundedOptions("bezier", deviation), RoundedOptions("bspline", deviation))
]
"""The rounder the corners are, the faster they are passed, but the farther from the straight lines they lead."""


def through_vias(planner: Planner[Any], problem: Problem, budget: Budget, progress: Progress) -> PlanResult:
    """Plan leg by leg, then along straight lines with corners of several sizes, and return the best of these motions.

    Path constraints, which hold all along, are held by the legs; straight lines with corners know nothing of them.

    Args:
        planner: plans the legs.
        problem: with vias.
        budget: half of it is for the legs.
        progress: called with the stages.
    """
    if any(tuple(one.during) != WHOLE for one in problem.path_constraints):
        detail = "this planner holds constraints on a part of the motion only where there are no vias"
        return PlanResult(failure=Failure("unsupported", detail))
    began = clock()
    legs = leg_by_leg(planner, problem, budget.share(_LEGS), progress)
    objective = problem.objective_parts()
    seconds, candidates, best = Counter(legs.timings), list[Candidate](), np.inf
    found = [Candidate(legs.trajectory, clock() - began)] if legs.trajectory is not None else []
    for k in range(len(_CORNERS) + 1):
        for candidate in found:
            cost = objective.cost(candidate.trajectory)
            if cost < best:
                best = cost
                candidates.append(candidate)
        # Rounded lines begin and end at rest, and hold no constraint.
        if k == len(_CORNERS) or budget.over or problem.moving or problem.path_constraints:
            break
        progress("rounded corners", k / len(_CORNERS))
        rounded = Rounded(_CORNERS[k]).plan(problem, budget, lambda stage, share: None)
        seconds.update(rounded.timings)
        found = [Candidate(rounded.trajectory, clock() - began)] if rounded.trajectory is not None else []
    info = {**legs.info, "cut_short": legs.info.get("cut_short", False) or budget.over}
    if not candidates:
        return PlanResult(None, legs.failure, seconds, info)
    *earlier, last = candidates
    return PlanResult(last.trajectory, None, seconds, info, tuple(earlier), last.seconds)
