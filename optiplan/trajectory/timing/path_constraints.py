"""Limits of a robot along a path q(s), as rows in the speed and acceleration of s.

With q' = v(s) sd and so on (primes are derivatives in s, sd and sdd the first and second derivative of s in time):

    joint velocity       |q' sd|                            <= limit
    joint acceleration   |q' sdd + q'' sd^2|                <= limit
    joint torque         |M q' sdd + (M q'' + c(q, q')) sd^2 + g|  <= limit
    tool speed           |J q'| sd                          <= limit,  of position and of orientation
    tool acceleration    |J q' sdd + (J q'' + J' q') sd^2|  <= limit,  a norm: 16 directions stand for it

M, c and g are mass matrix, Coriolis vector and gravity, J the tool's Jacobian. All but the norm are exact at each s
(Verscheure et al. 2009, Time-optimal path tracking for robots, eq. 6-10).
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array, Flags
from optiplan.records import dataclass
from optiplan.robot.batched.dynamics import inverse_dynamics
from optiplan.robot.robot import Limits, Robot
from optiplan.trajectory.samples import sample_times
from optiplan.trajectory.trajectory import Trajectory

_DIRECTIONS = 8  # of half a turn in the plane of the tool's acceleration
_RESERVE = 1e-4  # share of the tool's limits kept free for what happens between samples


@dataclass(frozen=True)
class ToolLimits:
    """Limits of a frame of the robot against the world; infinite where there is none.

    Attributes:
        frame: its name; must be one of the robot's.
        linear: of its origin, m/s.
        angular: rad/s.
        linear_acceleration: of its origin, m/s².
    """

    frame: str
    linear: float = np.inf
    angular: float = np.inf
    linear_acceleration: float = np.inf

    def __post_init__(self) -> None:
        for name in ("linear", "angular", "linear_acceleration"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"{name} = {getattr(self, name)} is not positive")


@dataclass(frozen=True, eq=False)
class Rows:
    """At k parameters s: sd <= speed and |A sdd + B sd^2 + G| <= bound.

    Attributes:
        s: (k,), increasing.
        speed: (k,), 1/s times the unit of s.
        A, B, G: (k, m).
        bound: (m,).
    """

    s: Array
    speed: Array
    A: Array
    B: Array
    G: Array
    bound: Array


class _RowBlock(NamedTuple):
    """Some columns of `Rows`: A, B, G (k, m) and bound (m,)."""

    A: Array
    B: Array
    G: Array
    bound: Array


def rows_at(path: Trajectory, robot: Robot, limits: Limits, tool: ToolLimits | None, s: Array) -> Rows:
    """The rows of the module's table at s (k,): joint acceleration, torque where limited, tool where limited.

    Joint velocity and tool speed are in `speed`; jerk is no row.
    """
    Q = [path(s, order) for order in range(3)]
    with np.errstate(divide="ignore"):
        speed = (limits.velocity / np.abs(Q[1])).min(axis=1)
    blocks = [_RowBlock(Q[1], Q[2], np.zeros_like(Q[1]), limits.acceleration)]
    limited = np.isfinite(limits.torque)
    if limited.any():
        blocks.append(_torque_rows(robot, Q, limits.torque, limited))
    if tool is not None:
        twist, acceleration = tool_motion(robot, tool.frame, Q)
        with np.errstate(divide="ignore"):
            for part, limit in ((twist[:, :3], tool.linear), (twist[:, 3:], tool.angular)):
                speed = np.minimum(speed, limit / np.linalg.norm(part, axis=1))
        if np.isfinite(tool.linear_acceleration):
            blocks.append(_tool_rows(twist[:, :3], acceleration[:, :3], tool.linear_acceleration))
    A, B, G, bound = (np.concatenate(parts, axis=-1) for parts in zip(*blocks, strict=True))
    return Rows(s, speed, A, B, G, bound)


def tool_scale(robot: Robot, tool: ToolLimits | None, trajectory: Trajectory, t: Array | None = None) -> float:
    """Factor on the duration at which the tool just keeps its limits; 0 where it has none.

    Holds at: times t (k,), `sample_times` without them, with a reserve of 1e-4.
    """
    t = sample_times(trajectory) if t is None else t
    if tool is None or not len(t):
        return 0.0
    return float(tool_shares(robot, tool, trajectory, t).max()) / (1.0 - _RESERVE)


def tool_shares(robot: Robot, tool: ToolLimits, trajectory: Trajectory, t: Array) -> Array:
    """Return the share of its limits that the tool takes at times t (k,): (k,); a slower motion takes less by as much.

    It is the largest of speed, turning speed and the root of the acceleration, each over its limit.
    """
    twist, acceleration = tool_motion(robot, tool.frame, [trajectory(t, order) for order in range(3)])
    speed, turn = np.linalg.norm(twist[:, :3], axis=1), np.linalg.norm(twist[:, 3:], axis=1)
    force = np.linalg.norm(acceleration[:, :3], axis=1)
    parts = speed / tool.linear, turn / tool.angular, np.sqrt(force / tool.linear_acceleration)
    return np.asarray(np.max(parts, axis=0))


def tool_motion(robot: Robot, frame: str, Q: list[Array]) -> tuple[Array, Array]:
    """Twist and its derivative of a frame in the world's axes: J q' and J q'' + J' q', each (k, 6), linear first.

    Args:
        robot: the robot.
        frame: its name.
        Q: configurations and their first and second derivative in anything, (k, n) each.
    """
    data, index, axes = robot.model.createData(), robot.frame_id(frame), pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    twist, acceleration = np.empty((2, len(Q[0]), 6))
    for i, (q, v, a) in enumerate(zip(*Q, strict=True)):
        pin.forwardKinematics(robot.model, data, q, v, a)
        twist[i] = pin.getFrameVelocity(robot.model, data, index, axes).vector
        acceleration[i] = pin.getFrameClassicalAcceleration(robot.model, data, index, axes).vector
    return twist, acceleration


def _torque_rows(robot: Robot, Q: Sequence[Array], torque: Array, limited: Flags) -> _RowBlock:
    """Return M q', M q'' + c(q, q') and g of the limited joints, N·m over powers of the unit of s, and their limits."""
    q, first, second = Q
    rest = np.zeros_like(q)
    G, A, B = (inverse_dynamics(robot, q, *rates) for rates in ((rest, rest), (rest, first), (first, second)))
    return _RowBlock((A - G)[:, limited], (B - G)[:, limited], G[:, limited], torque[limited])


def _tool_rows(forward: Array, acceleration: Array, limit: float) -> _RowBlock:
    """Directions in the plane of J q' and the path's curvature, in which every component keeps within the limit.

    Their polygon lies inside the circle's tangents, outside the circle by 1 / cos(pi / 16) = 2 % at most: the exact
    norm is for `tool_scale`.
    """
    length = np.linalg.norm(forward, axis=1, keepdims=True)
    e1 = forward / np.where(length > 0.0, length, 1.0)
    along = (acceleration * e1).sum(axis=1, keepdims=True)
    across = np.linalg.norm(acceleration - along * e1, axis=1, keepdims=True)
    angle = np.pi / _DIRECTIONS * np.arange(_DIRECTIONS)
    A, B = np.cos(angle) * length, np.cos(angle) * along + np.sin(angle) * across
    return _RowBlock(A, B, np.zeros_like(A), np.full(_DIRECTIONS, limit))
