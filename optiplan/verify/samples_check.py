"""Check that the samples of a trajectory, which other programs execute, are samples of the proved motion."""

import numpy as np

from optiplan.problem.problem import Problem
from optiplan.robot.limits import ORDERS
from optiplan.trajectory.sample_file import Samples
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.report import Check, VerifyPolicy


def samples(problem: Problem, trajectory: Trajectory, policy: VerifyPolicy, given: Samples) -> Check:
    """Times run from 0 to the end, and |q_k - q(t_k)|, |v_k - q'(t_k)|, |a_k - q''(t_k)| are within tolerances.

    Those are `position_tolerance`, and `rest_tolerance` times the limits of velocity and acceleration. Where the
    acceleration jumps, either side will do.
    """
    misfit = _misfit(trajectory, given)
    if misfit:
        return Check("samples", "exact", False, detail=misfit)
    t, last = given.t, trajectory.duration
    limits, rest = problem.limits, policy.rest_tolerance
    allowed = (np.full(trajectory.n, policy.position_tolerance), rest * limits.velocity, rest * limits.acceleration)
    inside = np.clip(t, 0.0, last)
    sides = (np.clip(np.nextafter(inside, -1.0) - 1e-9, 0.0, last), inside)
    worst = None
    for order, values in enumerate((given.q, given.v, given.a)):
        if values is None:
            continue
        found = trajectory(inside, order)
        if order == 2:
            found = np.stack([trajectory(side, 2) for side in sides])
            error = np.abs(values - found).min(axis=0)
        else:
            error = np.abs(values - found)
        share = error / allowed[order]
        k, j = divmod(int(np.argmax(share)), share.shape[1])
        if worst is None or share[k, j] > worst[0]:
            worst = (share[k, j], float(error[k, j]), float(allowed[order][j]), float(t[k]), j, order)
    assert worst is not None  # positions are always there
    share, error_most, limit, time, j, order = worst
    name, unit = problem.robot.joint_names[j], problem.robot.unit(ORDERS[order], j)
    kind = ("positions", "velocities", "accelerations")[order]
    detail = f"{len(t)} samples; farthest from the pieces are the {kind}"
    return Check("samples", "exact", bool(share <= 1.0), error_most, limit, unit, time, name, detail)


def _misfit(trajectory: Trajectory, given: Samples) -> str:
    """Return why these cannot be samples of the trajectory, or an empty text."""
    k, n = len(given.t), trajectory.n
    if given.t.ndim != 1 or k < 2:
        return f"found t of shape {given.t.shape}; expected two times or more"
    for name, values in (("q", given.q), ("v", given.v), ("a", given.a)):
        if values is not None and values.shape != (k, n):
            return f"found {name} of shape {values.shape}; expected ({k}, {n})"
        if values is not None and not np.isfinite(values).all():
            return f"found {name} that are not finite"
    if not (np.isfinite(given.t).all() and (np.diff(given.t) > 0.0).all()):
        return "found times that are not finite or do not increase"
    off = max(abs(given.t[0]), abs(given.t[-1] - trajectory.duration))
    if off > 1e-9 * max(1.0, trajectory.duration):
        return (
            f"found times from {given.t[0]:.9g} s to {given.t[-1]:.9g} s; expected 0 to {trajectory.duration:.9g} s, "
            "as the pieces"
        )
    return ""
