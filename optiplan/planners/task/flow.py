"""Join moves and lines so that the arm does not stop between them."""

from collections.abc import Sequence

from optiplan.planners.base import Budget, Progress
from optiplan.planners.task.chains import Done
from optiplan.problem.problem import Problem
from optiplan.trajectory.trajectory import Trajectory


def flowing(
    problem: Problem,
    done: Sequence[Done],
    motions: "Sequence[Trajectory | float]",
    budget: Budget,
    progress: Progress,
) -> Trajectory | None:
    return None
