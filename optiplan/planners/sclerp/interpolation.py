"""Points on a joint path become a curve with two continuous derivatives."""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pinocchio as pin
from scipy.interpolate import CubicSpline

from optiplan.arrays import Array
from optiplan.planners.sclerp.qp_stepping import ScrewStepper, SteppedPath
from optiplan.trajectory import polynomial
from optiplan.trajectory.trajectory import Trajectory

_TOLERANCE = 5e-7  # m and rad, at the checked points: half of the tolerance promised everywhere
_BETWEEN = (0.2, 0.5, 0.8)
_ROUNDS = 12
_MOST_KNOTS = 2000
_ANCHORS = 0.3  # rad or m between the steps that are kept; those between have the unevenness of steps
_SPACING = 0.01  # rad or m, the way of a tool's step that is worth a knot


def spline(joint_names: tuple[str, ...], s: Array, Q: Array) -> Trajectory:
    """The cubic spline through Q (k, n) at s (k,), s[0] = 0; twice continuously differentiable."""
    if np.ptp(Q, axis=0).max() < 1e-12:  # at rest: without the noise that divided differences make
        return Trajectory(joint_names, s[[0, -1]], Q[None, :1])
    curve = CubicSpline(s, Q)
    return Trajectory(joint_names, s, np.swapaxes(curve.c[::-1], 0, 1))


def on_screw(stepper: ScrewStepper, stepped: SteppedPath, stop: Callable[[], bool] = lambda: False) -> Trajectory:
    """Return a joint path q(s) along steps, within limits, with the tool within 1e-6 m and rad of X(s).

    The path passes through some of the stepped points. Where it violates the tolerance or a limit, the nearest point
    on the screw becomes a knot too; so it does not repeat the unevenness of the steps. All knots are on the screw.
    Between them the error is that of a cubic spline, which falls with the fourth power of their distance.

    Holds at: everywhere for the limits (exact extrema), three points between knots for the tool, with a reserve of a
    half. Both end with 2,000 knots, or when `stop` returns True.
    """
    names = stepper.tool.robot.joint_names
    kept = _spaced(stepped.Q, _ANCHORS)
    s, Q = stepped.s[kept], stepped.Q[kept]
    for _ in range(_ROUNDS):
        if stop():
            break
        path = spline(names, s, Q)
        wide = np.flatnonzero((_error(stepper, path, s) > _TOLERANCE) | _outside(stepper, path))
        found = [point for i in wide if (point := _between(stepper, stepped, path, s[i : i + 2])) is not None]
        if not found or len(s) + len(found) > _MOST_KNOTS:
            break
        order = np.argsort(np.concatenate([s, [x for x, _ in found]]), kind="stable")
        s = np.concatenate([s, [x for x, _ in found]])[order]
        Q = np.vstack([Q, [q for _, q in found]])[order]
    return spline(names, s, Q)


def through(joint_names: tuple[str, ...], Q: Array) -> Trajectory:
    """Smooth path through the steps Q (k, n) of a scheme, over the length of their polygon; close ones left out."""
    points = Q[_spaced(Q, _SPACING)]
    length = np.linalg.norm(np.diff(points, axis=0), axis=1)
    if length.sum() < 1e-9:
        return spline(joint_names, np.array([0.0, 1.0]), points[[0, 0]])
    return spline(joint_names, np.concatenate([[0.0], np.cumsum(length)]), points)


def _spaced(Q: Array, spacing: float) -> list[int]:
    """Indices of points of Q (k, n), the ends among them, that are at least `spacing` apart (rad or m, 2-norm)."""
    kept = [0]
    for k in range(1, len(Q) - 1):
        if np.linalg.norm(Q[k] - Q[kept[-1]]) >= spacing and np.linalg.norm(Q[-1] - Q[k]) >= 0.5 * spacing:
            kept.append(k)
    return [*kept, len(Q) - 1]


def _between(stepper: ScrewStepper, stepped: SteppedPath, path: Trajectory, ends: Array) -> tuple[float, Array] | None:
    """A point of the screw between two knots: the nearest to the path at the middle, else one of the stepped ones."""
    middle = float(0.5 * ends.sum())
    q = stepper.reach(middle, path(np.array([middle]))[0], stepper.inside())
    if q is not None:
        return middle, q
    inner = np.flatnonzero((stepped.s > ends[0]) & (stepped.s < ends[1]))
    if not len(inner):
        return None
    k = inner[np.abs(stepped.s[inner] - middle).argmin()]
    return float(stepped.s[k]), stepped.Q[k]


def _error(stepper: ScrewStepper, path: Trajectory, s: Array) -> Array:
    """Largest error of the tool, m or rad, at some points of each interval between s (k,): (k - 1,)."""
    worst = np.zeros(len(s) - 1)
    for u in _BETWEEN:
        middle = s[:-1] + u * np.diff(s)
        for i, (x, q) in enumerate(zip(middle, path(middle), strict=True)):
            off = stepper.screw.pose(x).actInv(stepper.tool.pose(q))
            worst[i] = max(worst[i], np.linalg.norm(off.translation), np.linalg.norm(pin.log3(off.rotation)))
    return worst


def _outside(stepper: ScrewStepper, path: Trajectory) -> npt.NDArray[np.bool_]:
    """Which pieces leave the joint limits anywhere: (m,)."""
    unit = path.unit_pieces(0)
    ends = polynomial.unit_extrema(unit.reshape(-1, unit.shape[2]))
    low, high = (x.reshape(unit.shape[:2]) for x in (ends.low, ends.high))
    return np.asarray(((low < stepper.low) | (high > stepper.high)).any(axis=1))
