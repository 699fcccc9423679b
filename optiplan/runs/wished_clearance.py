"""A clearance that nobody requires: kept where it costs little, since a motion that shaves an edge is of little use."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from optiplan.collision.floors import with_built
from optiplan.geometry.safety import Safety
from optiplan.planners.base import Budget
from optiplan.problem.problem import Problem, derived
from optiplan.records import dataclass
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.verify import verify

LONGER = 1.02
"""Cost / cost of the answer up to which a motion that keeps the wish takes its place."""

_PROOFS = 4.0
"""Proofs of the answer that fit in what remains of the budget, at least: one of it, two of the motion that keeps it."""


@dataclass(frozen=True, eq=False)
class Wish:
    """What became of a problem's `wished_clearance`.

    Attributes:
        clearance: m.
        motion: that keeps it in place of the answer; None where the answer keeps it, or none was found.
        longer: cost / cost of the answer, less 1; None where no motion was found that keeps it.
    """

    clearance: float
    motion: Trajectory | None = None
    longer: float | None = None

    @property
    def kept(self) -> bool:
        """Whether the answer keeps it, or the motion that takes its place."""
        return self.longer is not None and self.longer <= LONGER - 1.0

    def to_dict(self) -> dict[str, Any]:
        """An entry of a run's `info`."""
        return {"clearance": self.clearance, "kept": self.kept, "longer": self.longer}


Near = Callable[[Problem, Budget], Trajectory | None]
"""Looks for a motion of a problem near the answer, verified on that problem."""


def wished(problem: Problem, answer: Trajectory, proof: float, near: Near, budget: Budget) -> Wish | None:
    """Return what became of the wish; None without the time to see to it.

    Floors are those of a `clearance` of that distance: less about the start and the end, and of links built nearer.

    Args:
        problem: that wishes it.
        answer: its verified motion.
        proof: seconds that its proof took.
        near: looks for a motion that keeps it, where the answer does not.
        budget: what remains of it.
    """
    if budget.remaining < _PROOFS * proof:
        return None
    clearance = problem.wished_clearance
    required = with_built(Safety(clearance, clearance), problem.robot)
    asking = derived(problem, scene=replace(problem.scene, safety=required), wished_clearance=0.0)
    if verify(asking, answer).verified:
        return Wish(clearance, None, 0.0)
    motion = near(asking, budget.leaving(2.0 * proof))
    if motion is None:
        return Wish(clearance)
    wish = Wish(clearance, motion, problem.cost(motion) / problem.cost(answer) - 1.0)
    return wish if wish.kept else replace(wish, motion=None)
