"""Why a tool path cannot be followed any further: the place, the pose and the cause, as a `Failure`."""

from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.collision.model import CollisionModel
from optiplan.geometry.poses import pose_to_data
from optiplan.kinematics.ik.closed_form import closed_form
from optiplan.kinematics.ik.numeric import IkOptions, random_seeds, solve_ik
from optiplan.kinematics.manipulability import manipulability_measures
from optiplan.kinematics.singularities import singularity_model
from optiplan.planners.base import Budget, Failure, FailureKind
from optiplan.planners.cartesian.differential_ik import Tracker
from optiplan.planners.common.continuous_collision import first_contact
from optiplan.planners.common.failures import contact_witness
from optiplan.planners.common.refused_path import refused_path
from optiplan.planners.common.tolerances import POSITION_LIMIT_ROUNDING
from optiplan.records import dataclass
from optiplan.robot.limits import Limits
from optiplan.robot.robot import Robot
from optiplan.trajectory import polynomial
from optiplan.trajectory.trajectory import Trajectory

_NEAR = 0.05  # as a sine: a nearer singularity may end a path
_BEYOND = 1e-3  # of s: distance beyond the end at which the reach is checked
SINGULAR = 1e-3  # smallest singular value, 1 or m, above which a path does not end
_SEEDS = 60  # of the inverse kinematics, for the reach
_GOAL_TOLERANCE = 1e-6  # rad or m
_OUT_OF_RANGE = 1e-6  # share of the twist: a larger part outside the joints' range is no rounding


@dataclass(frozen=True, eq=False)
class Ending:
    """End of a path: the parameter s, the configuration q (n,), and the reason."""

    s: float
    q: Array
    kind: FailureKind
    cause: str
    words: str
    more: dict[str, Any]

    def failure(self, pose: pin.SE3) -> Failure:
        """Return the failure; its witness has the `fraction` s, the `pose` of the tool, `q` and the `cause`."""
        x, y, z = pose.translation
        place = f"{100.0 * self.s:.1f} % along the tool's path, at [{x:.4f}, {y:.4f}, {z:.4f}] m"
        witness = {"fraction": self.s, "pose": pose_to_data(pose), "q": self.q.tolist(), "cause": self.cause}
        return Failure(self.kind, f"{place}: {self.words}", witness | self.more)


def first_ending(
    model: CollisionModel, tracker: Tracker, followed: Trajectory, budget: Budget, last: Ending | None = None
) -> Failure | None:
    """Return the first obstacle, limit or singularity that ends a tool path early, its `last` ending, or None.

    Its witness has the followed path as a `motion`, where `refused_path` can time it. Once the budget is over, the
    answer means nothing.

    Args:
        model: of the robot in its scene.
        tracker: of the path.
        followed: q over s from 0 as far as the path could be followed.
        budget: polled while obstacles are looked for.
        last: why the path was followed no farther; None: no step beyond was possible, where it ends early.
    """
    if last is None and followed.duration < 1.0:
        last = _stuck(tracker, followed.duration, followed.end)
    elif last is None:
        last = other_branch(tracker.robot, followed.end, tracker.aim.goal)
    first = first_refusal(model, tracker.robot, followed, budget, last)
    return None if first is None else first.failure(tracker.path.pose(first.s))


def first_refusal(
    model: CollisionModel, robot: Robot, path: Trajectory, budget: Budget, last: Ending | None = None
) -> Ending | None:
    """Return where q(s) first meets a limit or an obstacle, or its `last` ending; the refused path is in `more`."""
    endings = [_limit(robot, path), _obstacle(model, path, budget), last]
    first = min((one for one in endings if one is not None), key=lambda one: one.s, default=None)
    return first and replace(first, more=first.more | refused_path([path], 0, first.s, robot.limits))


def stuck(tracker: Tracker, s: float, q: Array) -> Failure:
    """Why no step beyond s is possible from the configuration q (n,)."""
    return _stuck(tracker, s, q).failure(tracker.path.pose(s))


def limit_crossing(path: Trajectory, limits: Limits) -> tuple[float, int] | None:
    """The first parameter at which a joint leaves its limits, and the joint's index; exact up to bisection."""
    low, high, h = limits.lower - POSITION_LIMIT_ROUNDING, limits.upper + POSITION_LIMIT_ROUNDING, path.widths
    unit = path.unit_pieces(0)
    ends = polynomial.unit_extrema(unit.reshape(-1, unit.shape[2]))
    least, most, x_least, x_most = (a.reshape(unit.shape[:2]) for a in ends)
    first: tuple[float, int] | None = None
    for outside, x in ((least < low, x_least), (most > high, x_most)):
        pieces = np.flatnonzero(outside.any(axis=1))
        for j in np.flatnonzero(outside[pieces[0]]) if len(pieces) else ():
            inside, beyond = path.breakpoints[pieces[0]] + h[pieces[0]] * np.array([0.0, x[pieces[0], j]])
            while beyond - inside > 1e-12:
                middle = 0.5 * (inside + beyond)
                good = low[j] <= path(np.array([middle]))[0, j] <= high[j]
                inside, beyond = (middle, beyond) if good else (inside, middle)
            if first is None or inside < first[0]:
                first = float(inside), int(j)
    return first


def at_limit(robot: Robot, s: float, q: Array, joint: int, verb: str) -> Ending:
    """Return the end at q (n,) where a joint meets, or is at (`verb`), its nearer limit."""
    low, high, name = robot.limits.lower[joint], robot.limits.upper[joint], robot.joint_names[joint]
    bound = float(min(low, high, key=lambda limit: abs(limit - q[joint])))
    words = f"joint '{name}' {verb} its limit {bound:.4g}"
    return Ending(s, q, "limits", "joint limit", words, {"joint": name, "limit": bound})


def farthest_failure(goals: list[Array] | Failure, failures: list[Failure]) -> Failure:
    """Return the failure farthest along its path, after that of the goal if there is one."""
    farthest = max(failures, key=lambda failure: float(failure.witness.get("fraction", 1.0)))
    if not isinstance(goals, Failure):
        return farthest
    witness = {**goals.witness, **farthest.witness}
    return Failure(goals.kind, f"{goals.detail}; {farthest.detail}", witness)


def _limit(robot: Robot, path: Trajectory) -> Ending | None:
    crossing = limit_crossing(path, robot.limits)
    if crossing is None:
        return None
    s, j = crossing
    return at_limit(robot, s, path(np.array([s]))[0], j, "meets")


def _obstacle(model: CollisionModel, path: Trajectory, budget: Budget) -> Ending | None:
    touch = first_contact(model, path, lambda: budget.over)
    if touch is None:
        return None
    more = contact_witness(touch.q, touch.contact)
    return Ending(touch.t, touch.q, "collision", "obstacle", touch.contact.meeting, more)


def _stuck(tracker: Tracker, s: float, q: Array) -> Ending:
    """Return why the path ends: a singularity, the reach, or too few joints."""
    J = tracker.jacobian(q) / tracker.scale
    twist, smallest = tracker.twist(s), smallest_singular_value(tracker, q)
    missing = twist - J @ (np.linalg.pinv(J, rcond=_NEAR) @ twist)
    more: dict[str, Any] = {"measure": smallest}
    branch = other_branch(tracker.robot, q, tracker.aim.goal)
    if branch is not None and tracker.redundant and 1.0 - s < _BEYOND and smallest > SINGULAR:
        return branch
    if len(q) < len(J) and smallest > _NEAR and np.linalg.norm(missing) > _OUT_OF_RANGE * np.linalg.norm(twist):
        words = f"{len(q)} joints cannot move the tool in the way that the path asks for"
        return Ending(s, q, "unsupported", "reach", words, more)
    names = _singular(tracker.robot, q)
    near = f" near a singularity ({', '.join(names)})" if names else ""
    more["singular"] = names
    if not _reachable(tracker, min(1.0, s + _BEYOND)):
        return Ending(s, q, "reach", "reach", f"the poses beyond are out of reach{near}", more)
    words = f"joint rates grow without bound{near}; the smallest singular value of the Jacobian is {smallest:.2g}"
    return Ending(s, q, "singularity", "singularity", words, more)


def smallest_singular_value(tracker: Tracker, q: Array) -> float:
    """Return that of the scaled Jacobian at q (n,), 1 or m."""
    return float(manipulability_measures((tracker.jacobian(q) / tracker.scale)[None]).smallest[0])


def other_branch(robot: Robot, end: Array, goal: Array | None) -> Ending | None:
    """Return the ending of a path whose last configuration (n,) is not the goal's (n,), if it has one to end in."""
    if goal is None or np.abs(end - goal).max() <= _GOAL_TOLERANCE:
        return None
    j = int(np.argmax(np.abs(end - goal)))
    name = robot.joint_names[j]
    words = (
        f"the path ends in another configuration than the goal's ('{name}' at {end[j]:.4g} instead of {goal[j]:.4g}); "
        "a pose as the goal leaves the configuration open"
    )
    return Ending(1.0, end, "no-path", "branch", words, {"joint": name, "goal": goal.tolist()})


def _singular(robot: Robot, q: Array) -> list[str]:
    """Names of the singularities near q (n,), for the arms whose singularities have names."""
    known = singularity_model(robot)
    return [] if known is None else list(known.factors(q[None]).names(_NEAR)[0])


def _reachable(tracker: Tracker, s: float) -> bool:
    """Whether some configuration has the tool at X(s)."""
    robot, X = tracker.robot, tracker.path.pose(s)
    closed = closed_form(robot, tracker.frame) if tracker.aim.orientation else None
    if closed is not None:
        return bool(closed.solve(X.homogeneous[None]).valid.any())
    middle = np.clip(np.zeros(robot.n), robot.limits.lower, robot.limits.upper)
    seeds = random_seeds(robot, middle, np.random.default_rng(0), _SEEDS)
    orientation = IkOptions().orientation if tracker.aim.orientation else np.pi
    return bool(solve_ik(robot, tracker.frame, X, seeds, IkOptions(orientation=orientation, count=1)).solutions)
