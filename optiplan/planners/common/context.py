"""What the steps of one call of `plan` share: problem, model, budget, and wall time by stage."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import field

from optiplan.collision.kept_models import kept_planning_model
from optiplan.collision.model import CollisionModel
from optiplan.libraries import clock
from optiplan.planners.base import Budget
from optiplan.problem.problem import Problem
from optiplan.records import dataclass


class Stopwatch:
    """Accumulate wall time by stage in `seconds`, the `timings` of a PlanResult."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._counted = 0.0

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Add the time spent inside to `name`, without that of nested stages, which is added to theirs."""
        begin, before = clock(), self._counted
        try:
            yield
        finally:
            own = clock() - begin - (self._counted - before)
            self.seconds[name] = self.seconds.get(name, 0.0) + own
            self._counted += own

    @contextmanager
    def aside(self) -> Iterator[None]:
        """Add the time spent inside to no stage."""
        begin = clock()
        try:
            yield
        finally:
            self._counted += clock() - begin


@dataclass(frozen=True, eq=False)
class PlanContext:
    """Context of one call of `plan`; the model is that of the problem's robot in its scene."""

    problem: Problem
    model: CollisionModel
    budget: Budget
    watch: Stopwatch = field(default_factory=Stopwatch)

    @classmethod
    def of(cls, problem: Problem, budget: Budget) -> "PlanContext":
        """Return the context of a call that begins now."""
        return cls(problem, kept_planning_model(problem.robot, problem.scene, problem.tracking_error), budget)
