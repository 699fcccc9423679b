"""Inverse kinematics of any robot: in closed form where the arm allows it, else from many starts."""

from collections.abc import Iterable
from dataclasses import replace
from itertools import chain

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.geometry.poses import pose_error
from optiplan.kinematics.ik.closed_form import Solutions, closed_form
from optiplan.kinematics.ik.joint_wraps import apart, images, whole_turns
from optiplan.kinematics.ik.numeric import IkOptions, IkResult, joints_that_move, random_seeds, solve_ik
from optiplan.kinematics.singularities import NAMES
from optiplan.records import dataclass
from optiplan.robot.frames import frame_pose
from optiplan.robot.robot import Robot

_BRANCH_TOLERANCE = 1e-7
"""rad; branches that differ by less have merged."""

_STARTS = 200
_NUMERIC = "numeric"


@dataclass(frozen=True, eq=False)
class Solution:
    """A configuration that puts a frame at a pose.

    Attributes:
        q: (n,), rad or m; inside the limits where some image is, the nearest one to the configuration asked for.
        branch: its name, or "numeric".
        within_limits: whether q is.
        error: position (m) and orientation (rad) error by forward kinematics.
        singular: which of shoulder, elbow and wrist are singular; q is one representative then.
        images: for each joint, all values within its limits that are the same up to whole turns.
    """

    q: Array
    branch: str
    within_limits: bool
    error: tuple[float, float]
    singular: tuple[str, ...]
    images: list[Array]


@dataclass(frozen=True, eq=False)
class Answer:
    """All branches found, those within limits first, nearest to the wanted configuration first; and the nearest miss.

    Attributes:
        solutions: one a branch, and of free joints at a singular pose others that starts found.
        nearest: when none is within limits: the configuration within limits with the smallest error found, else None.
        reason: why none is within limits, in a sentence; empty else.
    """

    solutions: list[Solution]
    nearest: IkResult | None = None
    reason: str = ""


def inverse_kinematics(robot: Robot, frame: str, X_WG: pin.SE3, seeds: Iterable[Array], options: IkOptions) -> IkResult:
    """Return `solve_ik` from the branches of the closed form, and then from the seeds.

    The seeds are not used if a branch is within the limits and none is singular. The first seed (n,) chooses among
    whole turns.

    Raises:
        ValueError: there is no seed.
    """
    rest = iter(seeds)
    first = next(rest, None)
    closed = closed_form(robot, frame) if options.orientation < np.pi else None
    if closed is None or first is None:
        return solve_ik(robot, frame, X_WG, chain([] if first is None else [first], rest), options)
    found = closed.solve(X_WG.homogeneous[None])
    starts = [whole_turns(robot, q, first, 1)[0] for q in found.q[0]]
    inside = [q for q, valid in zip(starts, found.valid[0], strict=True) if valid and not robot.limits.outside(q).any()]
    if inside and not found.singular[0, found.valid[0]].any():
        return solve_ik(robot, frame, X_WG, inside, options)
    return solve_ik(robot, frame, X_WG, chain(inside, starts, [first], rest), options)


def answer(robot: Robot, frame: str, X_WG: pin.SE3, near: Array, options: IkOptions | None = None) -> Answer:
    """Find every branch of the closed form, or solutions from many starts; else the nearest miss within limits.

    Where no branch is within limits, or one that is singular is not, its free joints may still be: starts look for it.
    Joints that do not move the frame stay as they are in `near` (n,).
    """
    closed, options = closed_form(robot, frame), options or IkOptions()
    moving = joints_that_move(robot, frame)
    drawn = [*robot.configurations.values(), *random_seeds(robot, near, np.random.default_rng(0), _STARTS)]
    seeds = [near, *(np.where(moving, q, near) for q in drawn)]
    found = [] if closed is None else _branches(robot, near, closed.solve(X_WG.homogeneous[None]))
    miss = None
    if not any(s.within_limits for s in found) or any(s.singular and not s.within_limits for s in found):
        miss = inverse_kinematics(robot, frame, X_WG, seeds, options)
        known = [s.q for s in found if s.within_limits]
        found += [
            _solution(robot, q, near, _NUMERIC, pose_error(frame_pose(robot, q, frame), X_WG))
            for q in miss.solutions
            if all(apart(robot, q, other) > options.distinct for other in known)
        ]
    found.sort(key=lambda s: (not s.within_limits, float(np.abs(s.q - near).max())))
    if miss is None or (found and found[0].within_limits):
        return Answer(found)
    miss = replace(miss, solutions=[])
    return Answer(found, miss, _reason(robot, frame, found, miss))


def wanted_configuration(robot: Robot) -> Array:
    """Return the configuration `ready` (n,), else the first named one, else zero moved into the limits."""
    zero = np.clip(np.zeros(robot.n), robot.limits.lower, robot.limits.upper)
    first = next(iter(robot.configurations.values()), zero)
    return robot.configurations.get("ready", first)


def _branches(robot: Robot, near: Array, all_of: Solutions) -> list[Solution]:
    """Return the valid branches; of branches that merge at a singularity, the first."""
    result: list[Solution] = []
    for k in np.flatnonzero(all_of.valid[0]):
        q = all_of.q[0, k]
        if any(apart(robot, q, other.q) < _BRANCH_TOLERANCE for other in result):
            continue
        position, angle = all_of.error[0, k]
        solution = _solution(robot, q, near, all_of.branches[k], (float(position), float(angle)))
        names = tuple(name for name, yes in zip(NAMES, all_of.singular[0, k], strict=True) if yes)
        result.append(replace(solution, singular=names))
    return result


def _solution(robot: Robot, q: Array, near: Array, branch: str, error: tuple[float, float]) -> Solution:
    best = whole_turns(robot, q, near, 1)[0]
    return Solution(best, branch, not robot.limits.outside(best).any(), error, (), images(robot, q, near))


def _reason(robot: Robot, frame: str, found: list[Solution], miss: IkResult) -> str:
    least = f"the nearest pose within them misses by {miss.position_error:.3g} m and {miss.orientation_error:.3g} rad"
    if found:
        outside = robot.limits.outside(found[0].q)
        broken = [robot.joint_names[j] for j in np.flatnonzero(outside)]
        return f"every branch breaks joint limits (the nearest those of {', '.join(broken)}); {least}"
    return f"no configuration puts '{frame}' at this pose; within the joint limits, {least.replace(' within them', '')}"
