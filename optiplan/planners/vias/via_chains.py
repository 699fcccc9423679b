"""Chains of configurations from the start through all vias to a goal."""

import numpy as np
import numpy.typing as npt

from optiplan.arrays import Array
from optiplan.collision.model import CollisionModel
from optiplan.errors import InputError, Issue
from optiplan.planners.base import Budget, Failure
from optiplan.planners.common.failures import end_too_heavy, out_of_time
from optiplan.planners.common.goal_ranking import ranked_goals
from optiplan.planners.common.gravity import Gravity
from optiplan.planners.point_to_point.base import Options, PointToPoint
from optiplan.problem.goals import GoalOptions, goal_configurations
from optiplan.problem.problem import JointGoal, Problem, derived
from optiplan.trajectory.timing.lower_bound import lower_bounds

_POINT_TOLERANCE = 1e-9  # rad or m: points nearer than that are one
_CHOICES = 16  # configurations that reach a via


class ThroughVias(PointToPoint[Options]):
    """A planner of this family that passes vias by itself: the targets of its `profile` are chains (vias + 2, n)."""

    passes_vias = True

    def targets(self, problem: Problem, model: CollisionModel, budget: Budget) -> list[Array] | Failure:
        """Chains of configurations through the vias, that with the smallest sum of lower bounds first."""
        return ranked_chains(problem, model, budget, self.options.goals)


def via_times(problem: Problem, planner: str, duration: float | None) -> Array:
    """Times that the problem gives for its vias, (vias,) or (0,), s.

    Raises:
        InputError: the planner's option `duration` ends before the last of them.
    """
    times = np.array([via.time for via in problem.vias if via.time is not None])
    if len(times) and duration is not None and duration <= times[-1]:
        expected = f"more than the {times[-1]} s of the last via"
        raise InputError([Issue.of_option(planner, "duration", f"{duration} s", expected)])
    return times


def chain_tolerances(problem: Problem) -> Array:
    """Return how far each point of a chain may be missed, (vias + 2,), rad or m; 0 at the ends and at pose vias."""
    ats = [via.at for via in problem.vias]
    return np.array([0.0, *(at.tolerance if isinstance(at, JointGoal) else 0.0 for at in ats), 0.0])


def distinct(chain: Array, times: Array) -> npt.NDArray[np.bool_]:
    """Which points of a chain (k, n) to go through, (k,): equal neighbours are one, unless times tell them apart."""
    apart = np.abs(np.diff(chain, axis=0)).max(axis=1) > _POINT_TOLERANCE
    return np.concatenate([[True], apart | bool(len(times))])


def ranked_chains(problem: Problem, model: CollisionModel, budget: Budget, count: int) -> list[Array] | Failure:
    """Return up to `count` chains (vias + 2, n), one per goal configuration, the smallest sum of lower bounds first.

    Dynamic programming chooses among the configurations of each via so that the sum is smallest. Failure kinds are
    those of `ranked_goals`; the detail names the via.
    """
    goals = ranked_goals(problem, model, budget, count)
    if isinstance(goals, Failure):
        return goals
    chains, costs = [problem.start[None]], np.zeros(1)
    for k in range(len(problem.vias)):
        choices = _choices(problem, model, budget, k)
        if isinstance(choices, Failure):
            return choices
        chains, costs = _extended(problem, chains, costs, choices)
    chains, costs = _extended(problem, chains, costs, goals)
    return [chains[i] for i in np.argsort(costs, kind="stable")]


def _extended(problem: Problem, chains: list[Array], costs: Array, ends: list[Array]) -> tuple[list[Array], Array]:
    """The cheapest chain to each of the ends, and its cost."""
    bounds = np.array([lower_bounds(chain[-1], np.array(ends), problem.limits) for chain in chains])
    total = costs[:, None] + bounds
    best = total.argmin(axis=0)
    return [np.vstack([chains[i], end]) for i, end in zip(best, ends, strict=True)], total.min(axis=0)


def _choices(problem: Problem, model: CollisionModel, budget: Budget, k: int) -> list[Array] | Failure:
    options = GoalOptions(count=_CHOICES, stop=lambda: budget.over)
    there = derived(problem, goal=problem.vias[k].goal, vias=())
    found = goal_configurations(there, model, np.random.default_rng(problem.seed), options)
    if found.kind is not None:
        if budget.over:
            return out_of_time(budget, f"looking for configurations at via {k + 1}")
        return Failure(found.kind, f"via {k + 1}: {found.reason}", {**found.witness, "via": k + 1})
    gravity = Gravity(problem.robot, problem.limits.torque)
    light = [q for q in found.configurations if not gravity.too_much(q)]
    return light or end_too_heavy(gravity, np.array(found.configurations), f"via {k + 1}")
