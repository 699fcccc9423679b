"""Whether a motion holds a problem's path constraints."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from optiplan.arrays import Array
from optiplan.planners.base import Failure
from optiplan.problem.problem import Problem
from optiplan.trajectory.trajectory import Trajectory

if TYPE_CHECKING:
    from optiplan.problem.constraints.measures import Measure
    from optiplan.problem.constraints.statements import PathConstraint


_INSTANTS = 400
"""Number of instants at which a motion is checked; the proof is the verifier's."""


class Broken(NamedTuple):
    """A path constraint that a motion violates.

    Attributes:
        kept: the constraint.
        words: what is violated by how much, with the limit.
        by: the same as a number.
        time: of the largest violation, s.
        share: the same as a fraction of the duration.
    """

    kept: "Kept"
    words: str
    by: float
    time: float
    share: float


class WorstViolation(NamedTuple):
    """The largest violation of a path constraint.

    Attributes:
        by: at most 0 without a violation.
        state: number of the state.
        words: quantity and limit.
        name: of the constraint, for people.
    """

    by: float
    state: int
    words: str
    name: str


class Kept:
    """One path constraint: its inequalities, and its measures at poses of its frame if it has any.

    The rows of the inequalities are nearly linear and stricter than the constraint; the measures are exact.
    """

    def __init__(self, problem: Problem, one: "PathConstraint") -> None:
        from optiplan.planners.path_constraints.inequalities import inequalities
        from optiplan.planners.path_constraints.inequality import CompiledInequality, PairsApart
        from optiplan.problem.constraints.measures import FramePoses, measures
        from optiplan.problem.constraints.motions import PairClearance

        self.one = one
        self.inequalities: tuple[CompiledInequality | PairsApart, ...] = (
            (PairsApart(problem, one),)
            if isinstance(one, PairClearance)
            else tuple(CompiledInequality(problem.robot, stated) for stated in inequalities(one))
        )
        self._measures: list[Measure] = measures(one)
        self._poses = FramePoses.of(problem.robot, one) if self._measures else None

    @property
    def name(self) -> str:
        """Name of the constraint, for people."""
        return constraint_name(self.one)

    def worst(self, motion: Sequence[Array]) -> "WorstViolation":
        """Return the largest violation among states (N, n)."""
        if self._poses is None:
            least = np.min([each.least(motion) for each in self.inequalities], axis=0)
            k = int(np.argmin(least))
            return WorstViolation(-float(least[k]), k, f"{self.name} violated by {-least[k]:.3g}", self.name)
        X = self._poses(motion[0])
        found = []
        for measure in self._measures:
            value = measure.value(X)
            k = int(np.argmax(value))
            shown, limit = measure.shown(float(value[k])), measure.shown(measure.limit)
            words = f"{measure.quantity} by {shown:.4g} {measure.unit} of {limit:.4g} {measure.unit} allowed"
            found.append(WorstViolation(float(value[k]) - measure.limit, k, words, self.name))
        return max(found)


class PathConstraints:
    """The path constraints of one problem.

    Attributes:
        all: of them.
        instants: fractions of the duration at which one of them begins or ends.
    """

    def __init__(self, problem: Problem) -> None:
        self.all = tuple(Kept(problem, one) for one in problem.path_constraints)
        self.instants = np.array(sorted({u for kept in self.all for u in kept.one.during if 0.0 < u < 1.0}))

    def end_holds(self, q: Array) -> bool:
        """Return whether a motion can end, at rest, in a configuration (n,)."""
        if not self.all:
            return True
        from optiplan.problem.constraints.measures import ROUNDING

        return all(found.by <= ROUNDING for found in self._at_rest(q))

    def broken_at_rest(self, q: Array) -> WorstViolation | None:
        """Return the largest violation by a robot that rests on its way at q (n,), of what holds all the time."""
        if not self.all:
            return None
        from optiplan.problem.constraints.measures import ROUNDING

        broken = [found for found in self._at_rest(q, since=0.0) if not found.by <= ROUNDING]
        return max(broken, key=lambda found: found.by, default=None)

    def no_end(self, goals: Sequence[Array]) -> Failure:
        """Return the failure of goal configurations (n,) that all violate a constraint: the least violation."""
        worst = [max(self._at_rest(q), key=lambda found: found.by) for q in goals]
        nearest = int(np.argmin([found.by for found in worst]))
        words, name = worst[nearest].words, worst[nearest].name
        detail = f"no goal configuration found holds the path constraints; the nearest is {words} ({name})"
        return Failure("constraint", detail, {"constraint": name, "q": goals[nearest].tolist()})

    def _at_rest(self, q: Array, since: float = 1.0) -> list[WorstViolation]:
        """Return the violation, at rest at q (n,), of each constraint that holds from this fraction on to the end."""
        held = (kept for kept in self.all if kept.one.during[0] <= since and kept.one.during[1] == 1.0)
        still = np.zeros((1, len(q)))
        return [kept.worst([q[None], still, still]) for kept in held]

    def slowed(self, trajectory: Trajectory) -> Trajectory:
        """Return the motion, slowed down as far as constraints of speed and acceleration require."""
        factor = 1.0
        for kept in self.all:
            timed = [each for each in kept.inequalities if each.depends_on_rates]
            motion = _states(trajectory, kept.one)[1] if timed else []
            factor = max([factor, *(each.slower(motion) for each in timed)])
        return trajectory if factor == 1.0 else trajectory.scaled(trajectory.duration * factor)

    def broken(self, trajectory: Trajectory) -> list[Broken]:
        """Return the constraints that a motion violates at one of 400 instants, with the largest violation of each."""
        if not self.all:
            return []
        from optiplan.problem.constraints.measures import ROUNDING

        found = []
        for kept in self.all:
            u, motion = _states(trajectory, kept.one)
            worst = kept.worst(motion)
            if not worst.by <= ROUNDING:
                share = float(u[worst.state])
                found.append(Broken(kept, worst.words, worst.by, share * trajectory.duration, share))
        return found


def constraint_name(one: "PathConstraint") -> str:
    """Return the name of a constraint, for people: a user's own, or the key in a problem file."""
    from optiplan.problem.constraints.expression import Expression

    return one.name if isinstance(one, Expression) else one.KEY


def broken_constraint(one: Broken, trajectory: Trajectory, detail: str) -> Failure:
    """Return the failure of a search whose best attempt violates a constraint: which, when, and the configuration."""
    detail += f"; the best attempt is {one.words} ({one.kept.name}) at t = {one.time:.3f} s"
    witness = {"constraint": one.kept.name, "t": one.time, "q": trajectory(one.time).tolist()}
    return Failure("constraint", detail, witness)


def _states(trajectory: Trajectory, one: "PathConstraint") -> tuple[Array, list[Array]]:
    """Return fractions of the duration (N,) in a constraint's part of it, and position, velocity and acceleration."""
    low, high = one.during
    knots = trajectory.breakpoints / trajectory.duration
    u = np.concatenate([np.linspace(low, high, _INSTANTS), knots[(knots > low) & (knots < high)]])
    u = np.sort(u)
    return u, [trajectory(u * trajectory.duration, order) for order in range(3)]
