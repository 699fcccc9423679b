"""Context shared by the steps of one call of `plan`."""

from dataclasses import dataclass, field

from optiplan.collision.kept_models import kept_planning_model
from optiplan.collision.model import CollisionModel
from optiplan.planners.base import Budget
from optiplan.planners.common.stopwatch import Stopwatch
from optiplan.problem.problem import Problem


@dataclass(frozen=True, eq=False)
class Work:
    """Context of one call of `plan`; the model is that of the problem's robot in its scene."""

    problem: Problem
    model: CollisionModel
    budget: Budget
    watch: Stopwatch = field(default_factory=Stopwatch)

    @classmethod
    def on(cls, problem: Problem, budget: Budget) -> "Work":
        """Return the context of a call that begins."""
        return cls(problem, kept_planning_model(problem.robot, problem.scene), budget)
