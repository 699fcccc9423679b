"""Shorten a path on the constraints, and make it a smooth curve that holds them."""

import numpy as np

from optiplan.arrays import Array
from optiplan.libraries import loading
from optiplan.planners.common.continuous_collision import first_contact
from optiplan.planners.sampling.constrained.constrained_steps import ConstrainedSteps
from optiplan.planners.sampling.shortcutting import costs_along
from optiplan.planners.sampling.smoothing import DEGREE, SPANS, spline_along
from optiplan.trajectory.trajectory import Trajectory

_POINTS = 3  # projected for each span, so that the curve between them holds the constraints too
_LOOKS = 4  # samples of the curve between two of these
_STALE, _GAIN = 25, 0.005  # shortcuts in a row that gain less than this share of the path's cost


def shortcut(steps: ConstrainedSteps, path: Array, draws: Array) -> Array:
    """Return a path (m, n) of no higher cost: the one (k, n) with stretches walked straight.

    Each row of `draws` (attempts, 2), uniform in [0, 1), says between which shares of its length; after 25 in a row of
    little use, no more are tried.
    """
    stale = 0
    for row in draws:
        if len(path) < 3 or steps.budget.over or stale >= _STALE:
            break
        stale += 1
        along = costs_along(path, steps.units)
        i, j = np.sort(np.searchsorted(along, row * along[-1]))
        if j - i < 2:
            continue
        points = steps.joined(path[i], path[j])
        if points is None:
            continue
        new = np.vstack([path[i], points])
        gain = steps.cost(path[i : j + 1]) - steps.cost(new)
        if gain > 0.0:
            stale = 0 if gain > _GAIN * along[-1] else stale
            path = np.vstack([path[:i], new, path[j + 1 :]])
    return path


def smooth_curves(steps: ConstrainedSteps, waypoints: Array, names: tuple[str, ...]) -> list[Trajectory]:
    """Return smooth curves near a path (k, n), over s, that hold the constraints at samples and are proved free.

    A B-spline near the path (`smoothing.spline_along`) is sampled, the samples are projected onto the constraints, and
    a spline of degree five goes through them. Between samples at distance h it is off by the order of h^6; the straight
    segments of the path are off by h^2. The smoothest comes first.
    """
    along = costs_along(waypoints, steps.units)
    found: list[Trajectory] = []
    for spans in SPANS:
        if steps.budget.over or along[-1] == 0.0 or len(found) == 2:
            break
        curve = spline_along(names, along, waypoints, spans)
        held = curve if _holds(steps, curve, spans) else _projected(steps, curve, spans)
        if held is not None and first_contact(steps.check.model, held, lambda: steps.budget.over) is None:
            found.append(held)
    return found


def _projected(steps: ConstrainedSteps, curve: Trajectory, spans: int) -> Trajectory | None:
    """Return the spline through projected points of a curve; None where a point, or the spline, does not hold."""
    s = np.linspace(0.0, curve.duration, max(_POINTS * spans, 2 * DEGREE) + 1)
    points = [steps.manifold.project(q) for q in curve(s[1:-1])]
    whole = [q for q in points if q is not None]
    if len(whole) < len(points):
        return None
    with loading():
        from scipy.interpolate import make_interp_spline

    spline = make_interp_spline(s, np.vstack([curve.start, *whole, curve.end]), k=DEGREE)
    held = Trajectory.from_bspline(curve.joint_names, spline.t, spline.c, DEGREE)
    return held if _holds(steps, held, len(s) - 1) else None


def _holds(steps: ConstrainedSteps, curve: Trajectory, parts: int) -> bool:
    limits = steps.check.limits
    Q = curve(np.linspace(0.0, curve.duration, _LOOKS * parts + 1))
    inside = bool(((limits.lower <= Q) & (limits.upper >= Q)).all())
    return inside and all(steps.manifold.holds(q) for q in Q[1:-1])
