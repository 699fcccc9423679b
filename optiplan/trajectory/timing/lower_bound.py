"""Lower bounds of the duration of a motion: each joint's own fastest S-curve, or profile between moving states."""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from optiplan.arrays import Array
from optiplan.robot.limits import Limits
from optiplan.trajectory.state import State
from optiplan.trajectory.timing.s_curve import phases


def lower_bounds(start: Array, goals: Array, limits: Limits) -> Array:
    """Return the shortest duration conceivable from `start` to each goal, obstacles and position limits ignored.

    The slowest joint's own minimum time from rest to rest; no trajectory of the robot is shorter.

    Args:
        start: (n,) rad or m.
        goals: (k, n) rad or m.
        limits: of the n joints.

    Returns:
        (k,) in s.
    """
    return _longest(np.abs(goals - start).tobytes(), limits).copy()


@lru_cache(maxsize=64)
def _longest(ways: bytes, limits: Limits) -> Array:
    """The bounds (k,), s, of ways (k, n) >= 0, rad or m: planners ask for those of the same ends a dozen times."""
    return np.asarray(joint_times(np.frombuffer(ways).reshape(-1, len(limits.velocity)), limits).max(axis=1))


def moving_bounds(start: State, ends: Sequence[State], limits: Limits) -> Array:
    """Return lower bounds (k,), s, of durations from a state to others, without obstacles and position limits.

    The slowest joint's own minimum time: the S-curve of a joint at rest at both ends, Ruckig's profile of any other. A
    joint for which Ruckig finds none is ignored.
    """
    return np.array([_moving_bound(start, end, limits) for end in ends])


def _moving_bound(start: State, end: State, limits: Limits) -> float:
    from optiplan.trajectory.profiles.state_to_state import joint_times_between

    moving = (start.v != 0.0) | (start.a != 0.0) | (end.v != 0.0) | (end.a != 0.0)
    rest = np.where(moving, 0.0, joint_times(np.abs(end.q - start.q)[None], limits)[0])
    times = [rest.max(initial=0.0)]
    for j in np.flatnonzero(moving):
        one = slice(j, j + 1)
        here, there = (State.of(state.q[one], state.v[one], state.a[one]) for state in (start, end))
        found = joint_times_between(here, there, limits.of_joints([int(j)]))
        times.append(0.0 if found is None else float(found[0]))
    return float(max(times))


def joint_times(distances: Array, limits: Limits) -> Array:
    """Return the shortest time from rest to rest, s, of each joint over distances (k, n) >= 0, rad or m: (k, n)."""
    return np.where(distances == 0.0, 0.0, phases(distances, *limits.rates).total)


def lower_bound(start: Array, goal: Array, limits: Limits) -> float:
    """Return the bound of one goal of shape (n,): a duration in s, the denominator of `duration / lower_bound`."""
    return float(lower_bounds(start, goal[None], limits)[0])
