"""An optimisation problem of a curve: its variables, its terms, its costs, and the instants at which they are seen."""

from collections.abc import Sequence

import numpy as np

from optiplan.arrays import Array
from optiplan.collision.model import CollisionModel
from optiplan.planners.common.gravity import limits_at_rest
from optiplan.planners.trajopt.bspline_basis import SplineBasis
from optiplan.planners.trajopt.terms.contacts import ContactTerm, Margins, TimedContactTerm
from optiplan.planners.trajopt.terms.integrals import JerkCost
from optiplan.planners.trajopt.terms.term import Cost, CostModel, Curve, Instants, Term
from optiplan.planners.trajopt.terms.torques import TorqueTerm
from optiplan.problem.problem import Problem


class Transcription:
    """Terms and costs as functions of control points C (K, n) and duration T, at chosen samples of u.

    Attributes:
        contacts, torques: the terms that every problem has.
        terms: these two and `extra`, which hold at samples.
        costs: what a motion costs beside its time: jerk, and `further` ones.
        plain: whether there is nothing but contacts, torques and jerk, which the native core knows by itself.
    """

    def __init__(
        self,
        problem: Problem,
        model: CollisionModel,
        basis: SplineBasis,
        margins: Margins,
        extra: Sequence[Term] = (),
        costs: Sequence[Cost] = (),
    ) -> None:
        self.robot, self.basis, self.model, self.margins = problem.robot, basis, model, margins
        self.limits = problem.limits
        self.rates = problem.limits.rates
        self.objective = problem.objective
        self.contacts = TimedContactTerm(model, margins) if model.motions else ContactTerm(model, margins)
        torque = problem.limits.torque
        self.torques = TorqueTerm(problem.robot, torque, limits_at_rest(problem.robot, torque))
        self.terms: tuple[Term, ...] = (self.contacts, self.torques, *extra)
        self.jerk = (JerkCost(self.objective.jerk, basis),) if self.objective.jerk else ()
        self.further = tuple(costs)
        self.costs: tuple[Cost, ...] = (*self.jerk, *costs)
        self.plain = not (extra or costs or model.motions)
        self.set_samples(np.array([0.5]))

    def set_samples(self, u: Array) -> None:
        """Set the instants, as fractions of the duration, at which terms are evaluated."""
        self.samples = Instants.of(self.basis, u)
        for term in self.terms:
            term.begin(self.samples)

    def shortest_duration(self, control: Array) -> float:
        """Return the least duration of a curve with control points (K, n) within the limits of the joints, s."""
        return self.basis.shortest_duration(control, self.rates)

    def curve(self, control: Array, duration: float) -> Curve:
        """Return the curve with control points (K, n) and a duration, s, at the samples."""
        return Curve(control, duration, self.samples)

    def cost(self, curve: Curve) -> float:
        """Return the objective of a curve: weighted time and all costs, s."""
        return self.objective.time * curve.duration + sum(cost.value(curve) for cost in self.costs)

    def cost_model(self, curve: Curve, costs: Sequence[Cost] | None = None) -> CostModel:
        """Return the sum of these costs, or of all but the duration's, with its derivatives."""
        total = CostModel.none(self.basis.variables, curve.control.shape[1])
        for cost in self.costs if costs is None else costs:
            total = total.plus(cost.model(curve))
        return total
