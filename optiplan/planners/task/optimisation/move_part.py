"""A move in the program of a stretch: a spline of all joints whose ends may move."""

import numpy as np

from optiplan.arrays import Array, Index
from optiplan.planners.common.gravity import limits_at_rest
from optiplan.planners.task.optimisation.rate_rows import RateRows
from optiplan.planners.trajopt.bspline_basis import FIXED
from optiplan.planners.trajopt.optimizer import Optimiser
from optiplan.planners.trajopt.terms.contacts import ContactTerm, Margins
from optiplan.planners.trajopt.terms.term import Curve, Instants, Term
from optiplan.planners.trajopt.terms.torques import TorqueTerm


class MovePart:
    """A spline q = q(w) of control points (K, n), w in [0, 1] the share of its duration.

    Other variables of the stretch determine the states at its ends; these bend it smoothly, as quintic polynomials do.
    Its own variables are added to the free control points (K - 6, n). So a change of an end makes no kink next to it.

    Attributes:
        own: the optimiser of the move alone, which provides spline, samples and constraints.
        terms: of contacts, torques and path constraints.
        ends: (2, n) configurations.
    """

    def __init__(self, own: Optimiser, ends: Array, u: Array) -> None:
        self.own, self.basis, self.ends = own, own.basis, ends
        self.limits = own.problem.limits
        margins = Margins.between(own.model, ends, own.options.margin)
        robot, torque = own.problem.robot, self.limits.torque
        torques = TorqueTerm(robot, torque, limits_at_rest(robot, torque))
        self.terms: tuple[Term, ...] = (ContactTerm(own.model, margins), torques, *own.constraint_terms.begin())
        self._shapes = self.basis.end_shapes
        self.resample(u)

    def resample(self, u: Array) -> None:
        """Evaluate terms at shares u of the duration; every control point counts as one that moves."""
        at = Instants.of(self.basis, u)
        self.instants = Instants(self.basis, at.u, at.at, at.at)
        for term in self.terms:
            term.begin(self.instants)

    @property
    def count(self) -> int:
        """Number of its variables."""
        return int((self.basis.size - 2 * FIXED) * self.ends.shape[1])

    def control(self, variables: Array, first: Array, last: Array) -> Array:
        """Return the control points (K, n) with q, dq/dw, d²q/dw² at the ends, (3, n) each."""
        found = self._shapes @ np.vstack([first, last])
        found[self.basis.free] += variables.reshape(-1, self.ends.shape[1])
        return np.asarray(found)

    def fitted(self, w: Array, q: Array, first: Array, last: Array) -> Array:
        """Return the variables (count,) of the spline near q (N, n) at w (N,), with these states at its ends."""
        control = self.basis.fit(w, q, self.basis.ends(first, last))
        inside = np.clip(control, self.limits.lower, self.limits.upper)
        return np.asarray((inside - self._shapes @ np.vstack([first, last]))[self.basis.free].ravel())

    def control_gradient(self, place: Index, first: Array, last: Array) -> Array:
        """Return derivatives (K, n, C) of the control points, from those of the states at the ends, (3, n, C) each.

        Its own variables are at `place` (count,) of the C.
        """
        return self._gradient(np.eye(self.basis.size), place, np.concatenate([first, last]))

    def rates(self, control: Array, place: Index | None = None, ends: Array | None = None) -> RateRows:
        """Return the derivative control points over their limits.

        With their gradients where `place` and the derivatives `ends` (6, n, C) of both end states are given, as of
        `control_gradient`.
        """
        found = []
        for order, limit in enumerate(self.limits.rates, 1):
            rows = self.basis.derivative[order]
            value = rows @ control / limit
            by = np.zeros((*value.shape, 0))
            if place is not None and ends is not None:
                by = self._gradient(rows, place, ends) / limit[None, :, None]
            found.append(RateRows.of(order, value, by))
        return RateRows.joined(found)

    def _gradient(self, rows: Array, place: Index, ends: Array) -> Array:
        """Return derivatives (R, n, C) of rows (R, K) applied to the control points."""
        n = self.ends.shape[1]
        found = _applied(rows @ self._shapes, ends)
        found[:, np.arange(n), place.reshape(-1, n)] += rows[:, self.basis.free, None]
        return found

    def curve(self, control: Array, duration: float) -> Curve:
        """Return the motion in a duration, s, as terms see it."""
        return Curve(control, duration, self.instants)


def _applied(rows: Array, gradient: Array) -> Array:
    """Return rows (R, K) applied to a gradient (K, n, C): (R, n, C)."""
    return np.asarray(rows @ gradient.reshape(len(gradient), -1)).reshape(len(rows), *gradient.shape[1:])
