"""Motions and problems that the verifier's tests are made of."""

import numpy as np

from optiplan.problem.problem import JointGoal
from optiplan.trajectory.trajectory import Trajectory
from tests.unchecked_problem import unchecked_problem


def quintic(names, q0, q1, duration):
    """One piece, rest to rest: q0 + (q1 - q0) (10 s^3 - 15 s^4 + 6 s^5)."""
    c = np.zeros((1, 6, len(q0)))
    c[0, 0] = q0
    delta = np.subtract(q1, q0)
    for k, weight in ((3, 10.0), (4, -15.0), (5, 6.0)):
        c[0, k] = weight * delta / duration**k
    return Trajectory(tuple(names), np.array([0.0, duration]), c)


def smooth(names, points, duration):
    """Clamped B-spline of degree 4 with these control points, the first and last thrice: rest to rest."""
    control = np.vstack([points[0], points[0], points, points[-1], points[-1]])
    inner = len(control) - 4
    knots = np.concatenate([np.zeros(4), np.linspace(0.0, duration, inner + 1), np.full(4, duration)])
    return Trajectory.from_bspline(tuple(names), knots, control, 4)


def within_limits(trajectory, limits, fraction=0.999):
    """The same path, as fast as velocity, acceleration and jerk limits allow, times a fraction."""
    bounds = (limits.velocity, limits.acceleration, limits.jerk)
    worst = [np.abs(np.stack(trajectory.extrema(k + 1))).max(axis=0) / bound for k, bound in enumerate(bounds)]
    stretch = max(float(w.max()) ** (1.0 / (k + 1)) for k, w in enumerate(worst))
    return trajectory.scaled(trajectory.duration * stretch / fraction)


def problem_of(robot, trajectory, scene):
    """The problem that this trajectory was made for."""
    return unchecked_problem(
        name="test",
        robot=robot,
        scene=scene,
        start=trajectory.start,
        goal=(JointGoal(trajectory.end),),
        limits=robot.limits,
    )


def unchecked(trajectory, **changes):
    """A Trajectory that its own constructor would refuse."""
    broken = object.__new__(Trajectory)
    for name in ("joint_names", "breakpoints", "coefficients"):
        object.__setattr__(broken, name, changes.get(name, getattr(trajectory, name)))
    return broken
