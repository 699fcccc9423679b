"""A tool path as a joint path: one branch of the inverse kinematics, followed step by step.

A step predicts the next knot (Runge-Kutta on the joint rates) and puts the tool exactly on its path there (Newton). A
polynomial of degree five joins the two knots with their exact first and second derivatives. The step is accepted if the
polynomial keeps the tool on the path between the knots; otherwise it is made shorter. So the joint path is twice
continuously differentiable. It cannot jump to another branch: between two branches the tool would leave its path.
"""

import numpy as np

from optiplan.arrays import Array
from optiplan.collision.model import CollisionModel
from optiplan.planners.base import Budget, Failure
from optiplan.planners.cartesian.diagnosis import Ending, first_ending, stuck
from optiplan.planners.cartesian.differential_ik import Tracker
from optiplan.planners.common.failures import out_of_time
from optiplan.planners.common.tolerances import NO_MOTION
from optiplan.records import dataclass
from optiplan.trajectory.joining import standstill
from optiplan.trajectory.paths.hermite import hermite, hermite_trajectory
from optiplan.trajectory.trajectory import Trajectory

_TOLERANCE = 1e-6  # m and rad: the tool's error between knots
_SHARE = 0.3  # of the tolerance that the error may reach at the points checked
_BETWEEN = (0.15, 0.3, 0.5, 0.7, 0.85)  # the error of the polynomial is largest near the middle
_LONGEST, _SHORTEST = 0.125, 1e-7  # of s, a step
_FARTHEST = 0.3  # rad or m: largest motion of a joint in one step
_ASTRAY = 0.05  # rad or m: largest correction of a joint
_MOST_KNOTS = 3000
_DOING = "following the tool's path"


@dataclass
class _Knots:
    """The path so far: at each knot s and q, dq/ds, d²q/ds² (3, n)."""

    s: list[float]
    state: list[Array]

    def path(self, joint_names: tuple[str, ...]) -> Trajectory:
        return hermite_trajectory(joint_names, np.array(self.s), np.array(self.state))


def follow(model: CollisionModel, tracker: Tracker, start: Array, budget: Budget) -> Trajectory | Failure:
    """Return the joint path q(s), s from 0 to 1, with the frame within 1e-6 m and 1e-6 rad of path(s) for all s.

    Twice continuously differentiable; within the tracker's joint limits and free for all s.

    Args:
        model: of the robot in its scene.
        tracker: of the frame along its path.
        start: configuration (n,) that puts the frame at path(0).
        budget: polled at every step.

    Returns:
        A Failure where the path cannot be followed to its end: `limits`, `collision`, `singularity`, `reach`,
        `budget`, `cancelled`. `no-path`: it ends in another configuration than the aim's goal, or takes more than 3000
        knots. `unsupported`: the robot has too few joints. Its witness has the `fraction` (s), `pose`, `q` and the
        `cause`.

    Raises:
        ValueError: the start does not have the frame at path(0), within 1e-6 m and rad.
    """
    knots = _march(tracker, start, budget)
    if budget.over:
        return out_of_time(budget, _DOING)
    if len(knots.s) < 2:
        return stuck(tracker, 0.0, start)
    followed, last = knots.path(tracker.robot.joint_names), None
    if len(knots.s) == _MOST_KNOTS and knots.s[-1] < 1.0:
        words = f"so far the joints' path has {_MOST_KNOTS} knots, and no path may have more"
        last = Ending(followed.duration, followed.end, "no-path", "knots", words, {})
    ending = first_ending(model, tracker, followed, budget, last)
    if ending is not None:
        return out_of_time(budget, _DOING) if budget.over else ending
    still = max(np.abs(bound - start).max() for bound in followed.extrema(0)) < NO_MOTION
    return standstill(followed.joint_names, start, 1.0) if still else followed


def _march(tracker: Tracker, q: Array, budget: Budget) -> _Knots:
    """Knots from s = 0 on, to 1 or to where no step is short enough."""
    if np.abs(tracker.error(0.0, q)[tracker.rows]).max() > _TOLERANCE:
        raise ValueError("the tool path does not begin where the start configuration has the tool")
    knots, h = _Knots([0.0], [_state(tracker, 0.0, q)]), _LONGEST / 8.0
    while knots.s[-1] < 1.0 and h >= _SHORTEST and len(knots.s) < _MOST_KNOTS and not budget.over:
        s = knots.s[-1]
        end = 1.0 if s + 1.01 * h >= 1.0 else s + h
        state, error = _step(tracker, s, knots.state[-1], end)
        if state is not None and error <= 1.0:
            knots.s.append(end)
            knots.state.append(state)
        h = (end - s) * float(np.clip(0.9 * max(error, 1e-9) ** (-1.0 / 6.0), 0.3, 2.0))
        h = min(h, _LONGEST)
    return knots


def _step(tracker: Tracker, s: float, state: Array, end: float) -> tuple[Array | None, float]:
    """Return the state at `end`, and the largest error between the knots over its bound; infinite without a state."""
    h = end - s
    if h * np.abs(state[1]).max() > _FARTHEST:
        return None, np.inf
    predicted = _predict(tracker, s, state, end)
    q = tracker.correct(end, predicted)
    if q is None or np.abs(q - predicted).max() > _ASTRAY or np.abs(q - state[0]).max() > 2.0 * _FARTHEST:
        return None, np.inf
    new = _state(tracker, end, q)
    if _aimed(tracker, end):
        dq = tracker.arrive(q, 2.0 * (q - state[0]) / h - state[1])
        new = np.array([q, dq, tracker.joint_curvature(end, q, dq)])
    piece = _piece(state, new, h)
    errors = [np.abs(tracker.error(s + u * h, (u * h) ** np.arange(6) @ piece)).max() for u in _BETWEEN]
    return new, float(max(errors)) / (_SHARE * _TOLERANCE)


def _predict(tracker: Tracker, s: float, state: Array, end: float) -> Array:
    """Predict q at `end`: the goal that a redundant arm aims at, else a Runge-Kutta step of order four."""
    if _aimed(tracker, end) and tracker.aim.goal is not None:
        return tracker.aim.goal
    q, k1, h = state[0], state[1], end - s
    k2 = tracker.rate(s + h / 2.0, q + h / 2.0 * k1)
    k3 = tracker.rate(s + h / 2.0, q + h / 2.0 * k2)
    k4 = tracker.rate(end, q + h * k3)
    return np.asarray(q + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4))


def _aimed(tracker: Tracker, end: float) -> bool:
    """Whether a redundant arm arrives at its goal configuration at `end`."""
    return end == 1.0 and tracker.redundant and tracker.aim.goal is not None


def _state(tracker: Tracker, s: float, q: Array) -> Array:
    dq = tracker.rate(s, q)
    return np.array([q, dq, tracker.joint_curvature(s, q, dq)])


def _piece(a: Array, b: Array, h: float) -> Array:
    """Ascending powers (6, n) of the polynomial with value and two derivatives a (3, n) at 0 and b (3, n) at h."""
    return np.asarray(hermite(a, b, np.array([h]))[0] / h ** np.arange(6)[:, None])
