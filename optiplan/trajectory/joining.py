"""Join motions one after another or side by side, and cut a part out of a motion."""

from collections.abc import Iterable, Sequence

import numpy as np

from optiplan.arrays import Array, distinct
from optiplan.geometry.obstacle_motion import ObstacleMotion
from optiplan.trajectory import polynomial
from optiplan.trajectory.pieces import lasting
from optiplan.trajectory.trajectory import Trajectory


def join_trajectories(parts: Sequence[Trajectory]) -> Trajectory:
    """Concatenate motions; each begins where the one before ends. Segments are left out."""
    begins = np.concatenate([[0.0], np.cumsum([part.duration for part in parts])])
    breakpoints = [part.breakpoints[1:] + begin for part, begin in zip(parts, begins, strict=False)]
    coefficients = np.concatenate(_of_one_degree([part.coefficients for part in parts]))
    return Trajectory(parts[0].joint_names, *lasting(np.concatenate([[0.0], *breakpoints]), coefficients))


def standstill(joint_names: tuple[str, ...], q: Array, seconds: float) -> Trajectory:
    """Return the motion of joints that stay at q (n,)."""
    return Trajectory(joint_names, np.array([0.0, seconds]), q[None, None])


def cut_trajectory(trajectory: Trajectory, begin: float, end: float) -> Trajectory:
    """Return the motion between two times, s; its own time starts at 0, and its segments are left out.

    Exact however short the part is: no breakpoint is moved.

    Raises:
        ValueError: the part is empty.
    """
    if not end > begin:
        raise ValueError(f"found a part from {begin} to {end} s; expected an end after the beginning")
    own = trajectory.breakpoints
    first, last = np.searchsorted(own, begin, side="right"), np.searchsorted(own, end, side="left")
    t = np.concatenate([[begin], own[first:last], [end]])
    t = t[np.append(np.diff(t - begin) > 0.0, True)]  # two times a rounding apart may be one in the part's own time
    return Trajectory(trajectory.joint_names, t - begin, _coefficients_between(trajectory, t))


def with_obstacles(trajectory: Trajectory, motions: Sequence[ObstacleMotion]) -> Trajectory:
    """Return the motion of the robot's joints, followed by columns of the dynamic obstacles; itself without any.

    Exact: a piece within which an obstacle stops is divided there.
    """
    if not motions:
        return trajectory
    stops = {motion.until for motion in motions if 0.0 < motion.until < trajectory.duration}
    breakpoints = distinct(np.append(trajectory.breakpoints, sorted(stops)))
    columns = [_coefficients_between(trajectory, breakpoints)]
    columns += [np.swapaxes(motion.from_times(breakpoints[:-1]), 1, 2) for motion in motions]
    names = [f"obstacle {k} row {row}" for k, motion in enumerate(motions) for row in range(motion.size)]
    coefficients = np.concatenate(_of_one_degree(columns), axis=2)
    own = trajectory.joint_names
    return Trajectory((*own, *names_beside(names, own)), breakpoints, coefficients)


def names_beside(names: Sequence[str], taken: Iterable[str]) -> Sequence[str]:
    """Return names of columns or joints that a robot does not have, with primes where a joint of its own has one."""
    own = {*taken}
    while not own.isdisjoint(names):
        names = [f"{name}'" for name in names]
    return names


def with_resting_joints(
    motion: Trajectory, columns: Sequence[int], joint_names: tuple[str, ...], q: Array
) -> Trajectory:
    """Return the motion of all joints (n,) in which those of `columns` move, and the others stay at q (n,); exact."""
    coefficients = np.zeros((*motion.coefficients.shape[:2], len(joint_names)))
    coefficients[:, 0] = q
    coefficients[:, :, list(columns)] = motion.coefficients
    return Trajectory(joint_names, motion.breakpoints, coefficients)


def beside_each_other(motions: Sequence[tuple[Sequence[int], Trajectory]], joint_names: tuple[str, ...]) -> Trajectory:
    """Return the motion of all joints of motions that last equally long, each of some columns of its own; exact."""
    breakpoints = motions[0][1].breakpoints
    for _, motion in motions[1:]:
        breakpoints = distinct(np.append(breakpoints, motion.breakpoints))
    pieces = _of_one_degree([_coefficients_between(motion, breakpoints) for _, motion in motions])
    coefficients = np.zeros((*pieces[0].shape[:2], len(joint_names)))
    for (columns, _), own in zip(motions, pieces, strict=True):
        coefficients[:, :, list(columns)] = own
    return Trajectory(joint_names, breakpoints, coefficients)


def _coefficients_between(trajectory: Trajectory, t: Array) -> Array:
    """Return the coefficients (k, degree + 1, n) of a motion on pieces from t_i to t_{i+1}; t (k + 1,), s.

    Every breakpoint of the motion between the first and the last time must be among them.
    """
    own = trajectory.breakpoints
    piece = np.searchsorted(own[1:-1], t[:-1], side="right")
    return polynomial.shifted(trajectory.coefficients[piece], t[:-1] - own[piece])


def _of_one_degree(coefficients: Sequence[Array]) -> list[Array]:
    """Return coefficients (m, degree + 1, n) with zeros for the powers that only others have."""
    size = max(one.shape[1] for one in coefficients)
    return [np.pad(one, ((0, 0), (0, size - one.shape[1]), (0, 0))) for one in coefficients]
