"""Check `via`: the vias are passed in order, each within its tolerance."""

from typing import Any

import numpy as np

from optiplan.arrays import Array
from optiplan.problem.problem import JointGoal, PoseGoal, Problem
from optiplan.records import dataclass
from optiplan.robot.frames import pose_errors
from optiplan.trajectory import polynomial
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.continuous.frame_motion import FrameMotion
from optiplan.verify.limit_checks import Miss, miss
from optiplan.verify.report import Check
from optiplan.verify.tolerances import POSITION_ROUNDING

_HALVINGS = 40
_RATE = 500.0  # Hz: samples of the distance to a pose; the dips between them are followed to their bottom
_MOST_SAMPLES = 100_000
_CHUNK = 5_000  # samples at once, to limit memory


@dataclass(frozen=True)
class _Passage:
    """Passage of a via: first at `entered` (s), None when never; nearest at `nearest` (s), where it has this miss."""

    entered: float | None
    nearest: float
    miss: Miss


def vias(problem: Problem, trajectory: Trajectory) -> Check:
    """Times t_1 <= t_2 <= … exist at which the motion is within the tolerances of via 1, 2 and so on.

    Each is the earliest that the one before leaves: if any times exist, these do. Joint values are passed where
    max_j |q_j(t) - q_j| <= tolerance, on the roots of the polynomials. Poses are looked for at samples, 500 a second
    and all breakpoints, and at the nearest approaches between them.
    """
    count, passages, since = len(problem.vias), [], 0.0
    exact = all(isinstance(via.at, JointGoal) for via in problem.vias)
    for via in problem.vias:
        passage = _passage(problem, trajectory, via.at, since)
        passages.append(passage)
        if passage.entered is None:
            break
        since = passage.entered
    worst = max(passages, key=lambda one: (one.entered is None, one.miss.ratio))
    k, off = passages.index(worst) + 1, worst.miss
    passed = worst.entered is not None
    detail = f"all {count} in order; nearest to its tolerance is via {k}" if passed else _missed(k, count, since, off)
    witness: dict[str, Any] = {"via": k, "times": [one.nearest for one in passages if one.entered is not None]}
    witness |= {"errors": [one.miss.error for one in passages], "q": trajectory(np.array([worst.nearest]))[0].tolist()}
    kind = "exact" if exact else "sampled"
    return Check("via", kind, passed, off.error, off.limit, off.unit, worst.nearest, off.what, detail, witness)


def _missed(k: int, count: int, since: float, off: Miss) -> str:
    after = f" after via {k - 1}, which is passed at {since:.3f} s," if k > 1 else ""
    return f"via {k} of {count} is missed by {off.error:.3g} {off.unit}{after} allowed are {off.limit:.3g}"


def _passage(problem: Problem, trajectory: Trajectory, at: JointGoal | PoseGoal, since: float) -> _Passage:
    if isinstance(at, JointGoal):
        return _of_joints(problem, trajectory, at, since)
    if not miss(problem, at, trajectory.start):
        return _Passage(None, since, Miss(np.inf, 0.0, "a via that nothing can be measured of", ""))
    return _of_pose(problem, trajectory, at, since)


def _ratios(problem: Problem, at: PoseGoal, Q: Array) -> Array:
    """Return how far configurations Q (N, n) miss a pose, over its tolerances: (N,)."""
    errors = pose_errors(FrameMotion(problem.robot, at.frame).poses(Q), at.X_WG.homogeneous)
    return np.asarray((errors / (np.array([at.position, at.orientation]) + POSITION_ROUNDING)).max(axis=1))


def _of_joints(problem: Problem, trajectory: Trajectory, at: JointGoal, since: float) -> _Passage:
    entered = _entry(trajectory, at.q, at.tolerance + POSITION_ROUNDING, since)
    inner = trajectory.breakpoints[trajectory.breakpoints >= since]
    known = np.abs(trajectory(np.append(inner, since)) - at.q).max(axis=1)
    low, high = 0.0, float(known.min())
    nearest = float(np.append(inner, since)[known.argmin()])
    for _ in range(_HALVINGS if high > 0.0 else 0):  # the smallest tolerance that would do
        middle = 0.5 * (low + high)
        time = _entry(trajectory, at.q, middle, since)
        low, high, nearest = (middle, high, nearest) if time is None else (low, middle, time)
    error = np.abs(trajectory(np.array([nearest]))[0] - at.q)
    j = int(error.argmax())
    name, unit = problem.robot.joint_names[j], problem.robot.unit("position", j)
    return _Passage(entered, nearest, Miss(float(error[j]), at.tolerance, name, unit))


def _entry(trajectory: Trajectory, q: Array, tolerance: float, since: float) -> float | None:
    """The earliest t >= since (s) with max_j |q_j(t) - q_j| <= tolerance, exactly; q is (n,).

    On a piece such times make up intervals that begin at its start or at a root of some q_j(t) - q_j ± tolerance.
    """
    starts, h, c = trajectory.breakpoints[:-1], trajectory.widths, trajectory.unit_pieces(0).copy()
    c[:, :, 0] -= q
    reach = (np.abs(c[:, :, 0]) - np.abs(c[:, :, 1:]).sum(axis=2)).max(axis=1)  # the distance is nowhere smaller
    near = (reach <= tolerance) & (trajectory.breakpoints[1:] >= since)
    if not near.any():
        return None
    c, starts, h = c[near], starts[near], h[near]
    m, n, size = c.shape
    bands = np.concatenate([c, c], axis=1)
    bands[:, :, 0] += tolerance * np.repeat([-1.0, 1.0], n)
    roots = polynomial.unit_roots(bands.reshape(2 * m * n, size)).reshape(m, -1)
    first = np.clip((since - starts) / h, 0.0, 1.0)[:, None]
    x = np.sort(np.concatenate([first, np.ones((m, 1)), np.maximum(roots, first)], axis=1), axis=1)
    distance = np.abs(polynomial.evaluate(c[:, :, None, :], x[:, None, :])).max(axis=1)
    inside = distance <= tolerance + 1e-12 * (1.0 + np.abs(q).max())
    if not inside.any():
        return None
    i = int(inside.any(axis=1).argmax())
    return float(starts[i] + h[i] * x[i, inside[i].argmax()])


def _of_pose(problem: Problem, trajectory: Trajectory, at: PoseGoal, since: float) -> _Passage:
    from scipy.optimize import minimize_scalar

    def parts(t: float) -> list[Miss]:
        return miss(problem, at, trajectory(np.array([t]))[0])

    def ratio(t: float) -> float:
        return float(np.max([part.ratio for part in parts(t)]))

    count = int(min(_MOST_SAMPLES, np.ceil((trajectory.duration - since) * _RATE))) + 1
    inner = trajectory.breakpoints[trajectory.breakpoints > since]
    t = np.union1d(np.linspace(since, trajectory.duration, count), inner)
    chunks = np.array_split(t, np.arange(_CHUNK, len(t), _CHUNK))
    r = np.concatenate([_ratios(problem, at, trajectory(part)) for part in chunks])
    entered, best = None, (float(r.min()), float(t[r.argmin()]))
    padded = np.concatenate([[np.inf], r, [np.inf]])
    for k in np.flatnonzero((r <= padded[:-2]) & (r <= padded[2:]) | (r <= 1.0)).tolist():
        found = (ratio(float(t[k])), float(t[k]))
        if found[0] > 1.0:
            bounds = (float(t[max(k - 1, 0)]), float(t[min(k + 1, len(t) - 1)]))
            dip = minimize_scalar(ratio, bounds=bounds, method="bounded", options={"xatol": 1e-12})
            found = min(found, (float(dip.fun), float(dip.x)))
        best = min(best, found)
        if found[0] <= 1.0:
            entered = found[1]
            break
    worst = max(parts(best[1]), key=lambda part: part.ratio)
    return _Passage(entered, best[1], worst)
