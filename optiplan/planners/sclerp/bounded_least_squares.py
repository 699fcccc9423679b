"""Bounded least squares, small and dense: the quadratic program of one step."""

import numpy as np

from optiplan.arrays import Array

_ROUNDING = 1e-12  # of the gradient


def bounded_least_squares(A: Array, b: Array, bounds: tuple[Array, Array], towards: Array, weight: float) -> Array:
    """Return the x that minimises |A x - b|² + weight |x - towards|² subject to low <= x <= high.

    A primal active-set method. From a point within the bounds it steps to the optimum over the free components, or to
    the first bound on the way; that component is then held. At an optimum, the held component with the largest gain is
    freed. The cost never rises and no set of held components recurs, so the method ends. The program is strictly
    convex, so the result is the only solution.

    Args:
        A: (m, n).
        b: (m,).
        bounds: low (n,) and high (n,), low <= high.
        towards: (n,).
        weight: > 0.
    """
    low, high = bounds
    H, g = A.T @ A + weight * np.eye(A.shape[1]), A.T @ b + weight * towards
    x = np.clip(0.0, low, high)
    held = np.zeros(len(x), dtype=bool)
    for _ in range(100 * len(x)):
        free = ~held
        step = np.zeros(len(x))
        if free.any():
            step[free] = np.linalg.solve(H[np.ix_(free, free)], (g - H @ x)[free])
        step_share = _step_shares(x, step, low, high)
        k = int(np.argmin(step_share))
        if step_share[k] < 1.0:
            x = x + step_share[k] * step
            x[k] = high[k] if step[k] > 0.0 else low[k]
            held[k] = True
            continue
        x = np.asarray(x + step)
        descent = g - H @ x  # of a held component: points back inside if it gains by leaving its bound
        gain = np.where(held & (low < high), np.where(x <= low, descent, -descent), 0.0)
        k = int(np.argmax(gain))
        if gain[k] <= _ROUNDING:
            break
        held[k] = False
    return np.asarray(x)


def _step_shares(x: Array, step: Array, low: Array, high: Array) -> Array:
    """Share of the step that each component may take before its bound, (n,); infinite where it does not move."""
    bound = np.where(step > 0.0, high, low)
    moving = step != 0.0
    step_share = np.full(len(x), np.inf)
    step_share[moving] = np.maximum((bound - x)[moving] / step[moving], 0.0)
    return step_share
