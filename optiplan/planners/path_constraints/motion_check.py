"""Whether a motion holds a problem's path constraints."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from optiplan.arrays import Array
from optiplan.planners.base import Failure
from optiplan.planners.path_constraints.clearance import PairsApart
from optiplan.planners.path_constraints.inequalities import inequalities
from optiplan.planners.path_constraints.inequality import CompiledInequality
from optiplan.problem.constraints.base import WHOLE
from optiplan.problem.constraints.expression import Expression
from optiplan.problem.constraints.measures import ROUNDING, FramePoses, Measure, measures
from optiplan.problem.constraints.motions import PairClearance
from optiplan.problem.constraints.statements import PathConstraint
from optiplan.problem.problem import Problem
from optiplan.trajectory.trajectory import Trajectory

_INSTANTS = 400
"""At which a motion is looked at; the proof is the verifier's."""


@dataclass(frozen=True, eq=False)
class Broken:
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


class Kept:
    """One path constraint: its inequalities, and its own measures at poses of its frame where it has some.

    Inequalities are made so that their rows are nearly linear, and hold less than the constraint allows; measures are
    exact.
    """

    def __init__(self, problem: Problem, one: PathConstraint) -> None:
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

    def worst(self, motion: Sequence[Array]) -> tuple[float, int, str]:
        """Return the largest violation among states (N, n), at most 0 where there is none, where, and in words."""
        if self._poses is None:
            least = np.min([each.least(motion) for each in self.inequalities], axis=0)
            k = int(np.argmin(least))
            return -float(least[k]), k, f"{self.name} violated by {-least[k]:.3g}"
        X = self._poses(motion[0])
        found = []
        for measure in self._measures:
            value = measure.value(X)
            k = int(np.argmax(value))
            told, limit = measure.told(float(value[k])), measure.told(measure.limit)
            words = f"{measure.quantity} by {told:.4g} {measure.unit} of {limit:.4g} {measure.unit} allowed"
            found.append((float(value[k]) - measure.limit, k, words))
        return max(found)


class PathConstraints:
    """The path constraints of one problem.

    Attributes:
        all: of them.
        instants: fractions of the duration at which one of them begins or ends.
    """

    def __init__(self, problem: Problem) -> None:
        self.all = tuple(Kept(problem, one) for one in problem.path_constraints)
        self.instants = np.array(sorted({u for one in problem.path_constraints for u in one.during} - set(WHOLE)))

    def end_holds(self, q: Array) -> bool:
        """Return whether a motion can end, at rest, in a configuration (n,)."""
        return all(violation <= ROUNDING for violation, *_ in self._at_the_end(q))

    def no_end(self, goals: Sequence[Array]) -> Failure:
        """Return the failure of goal configurations (n,) of which none holds all constraints: the one nearest to it."""
        worst = [max(self._at_the_end(q), key=lambda found: found[0]) for q in goals]
        nearest = int(np.argmin([violation for violation, *_ in worst]))
        _, words, name = worst[nearest]
        detail = f"no goal configuration found holds the path constraints; the nearest is {words} ({name})"
        return Failure("constraint", detail, {"constraint": name, "q": goals[nearest].tolist()})

    def _at_the_end(self, q: Array) -> list[tuple[float, str, str]]:
        """Return the violation, in words too, of each constraint that holds at the end, by a configuration (n,)."""
        found, still = [], np.zeros((1, len(q)))
        for kept in self.all:
            if kept.one.during[1] == 1.0:
                violation, _, words = kept.worst([q[None], still, still])
                found.append((violation, words, kept.name))
        return found

    def slowed(self, trajectory: Trajectory) -> Trajectory:
        """Return the motion, slowed down as far as constraints of speed and acceleration ask for it."""
        factor = 1.0
        for kept in self.all:
            timed = [each for each in kept.inequalities if each.depends_on_rates]
            motion = _states(trajectory, kept.one)[1] if timed else []
            factor = max([factor, *(each.slower(motion) for each in timed)])
        return trajectory if factor == 1.0 else trajectory.scaled(trajectory.duration * factor)

    def broken(self, trajectory: Trajectory) -> list[Broken]:
        """Return the constraints that a motion violates at one of 400 instants, with the largest violation of each."""
        found = []
        for kept in self.all:
            u, motion = _states(trajectory, kept.one)
            by, k, words = kept.worst(motion)
            if not by <= ROUNDING:
                found.append(Broken(kept, words, by, float(u[k]) * trajectory.duration, float(u[k])))
        return found


def constraint_name(one: PathConstraint) -> str:
    """Return the name of a constraint, for people: a user's own, or the key in a problem file."""
    return one.name if isinstance(one, Expression) else one.KEY


def broken_constraint(one: Broken, trajectory: Trajectory, detail: str) -> Failure:
    """Return the failure of a search whose best attempt violates a constraint: which, when, and the configuration."""
    detail += f"; the best attempt is {one.words} ({one.kept.name}) at t = {one.time:.3f} s"
    witness = {"constraint": one.kept.name, "t": one.time, "q": trajectory(one.time).tolist()}
    return Failure("constraint", detail, witness)


def _states(trajectory: Trajectory, one: PathConstraint) -> tuple[Array, list[Array]]:
    """Return fractions of the duration (N,) in a constraint's part of it, and position, velocity and acceleration."""
    low, high = one.during
    knots = trajectory.breakpoints / trajectory.duration
    u = np.concatenate([np.linspace(low, high, _INSTANTS), knots[(knots > low) & (knots < high)]])
    u = np.sort(u)
    return u, [trajectory(u * trajectory.duration, order) for order in range(3)]
