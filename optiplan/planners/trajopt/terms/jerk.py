"""The cost of jerk."""

import numpy as np

from optiplan.planners.trajopt.bspline_basis import REACH, SplineBasis
from optiplan.planners.trajopt.terms.term import CostModel, Curve


class JerkCost:
    """w * (integral of squared jerk) = w T^-5 C' H C; exact at all times."""

    name = "jerk"
    timed = True

    def __init__(self, weight: float, basis: SplineBasis) -> None:
        self.weight, self.basis = weight, basis
        self._half = basis.by_variables(basis.jerk_gram)  # (K, M)
        gram = basis.by_variables(self._half.T)  # (M, M)
        points = len(gram)
        self._band = np.zeros((points, REACH))
        for d in range(min(REACH, points)):
            self._band[: points - d, d] = np.diagonal(gram, d)

    def value(self, curve: Curve) -> float:
        """Return the weighted cost, s."""
        scale = self.weight * curve.duration**-5
        return scale * float(np.sum(curve.control * (self.basis.jerk_gram @ curve.control)))

    def model(self, curve: Curve) -> CostModel:
        """Return the cost with its derivatives."""
        scale, cost = self.weight * curve.duration**-5, self.value(curve)
        gradient = 2.0 * scale * (self._half.T @ curve.control).ravel()
        joints = curve.control.shape[1]
        band = np.repeat(2.0 * scale * self._band[:, :, None], joints, axis=2)
        return CostModel(cost, gradient, -5.0 * cost / curve.duration, band)
