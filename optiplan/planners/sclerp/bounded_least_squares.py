"""Bounded least squares, small and dense: the quadratic program of one step."""

import numpy as np
from scipy.optimize import lsq_linear

from optiplan.arrays import Array

_ROUNDING = 1e-12  # of the gradient


def bounded_least_squares(A: Array, b: Array, bounds: tuple[Array, Array], towards: Array, weight: float) -> Array:
    """Return the x that minimises |A x - b|² + weight |x - towards|² subject to low <= x <= high.

    The rows sqrt(weight) (x - towards) are stacked below A x - b, which needs half the digits of the normal equations.
    SciPy's active-set method is then exact to rounding; the controller's, made for speed, is not at weights of 1e-8.

    Args:
        A: (m, n).
        b: (m,).
        bounds: low (n,) and high (n,), low <= high.
        towards: (n,).
        weight: > 0.
    """
    low, high = bounds
    root, n = np.sqrt(weight), A.shape[1]
    stacked, right = np.vstack([A, root * np.eye(n)]), np.concatenate([b, root * towards])
    above = np.nextafter(high, np.inf)  # lsq_linear takes no bounds that are equal
    x: Array = np.linalg.lstsq(stacked, right, rcond=-1)[0]  # as lsq_linear begins, and ends where it is within bounds
    if ((low <= x) & (x <= above)).all():
        return np.asarray(np.clip(x, low, high))
    found = lsq_linear(stacked, right, (low, above), method="bvls", tol=_ROUNDING, max_iter=100 * n)
    return np.asarray(np.clip(found.x, low, high))
