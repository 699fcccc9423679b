"""The scheme `qp`: along the screw itself, every step a quadratic program within position and velocity limits."""

from collections.abc import Callable
from functools import cached_property

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.geometry.dual_quaternion import DualQuaternion
from optiplan.planners.sclerp.bounded_least_squares import bounded_least_squares
from optiplan.planners.sclerp.options import SclerpOptions
from optiplan.planners.sclerp.screw_kinematics import ScrewTool
from optiplan.records import dataclass

_CLOSE = 1e-10  # m and rad: how near to the screw a step has to end
_CORRECTIONS = 8
_PROGRESS = 0.5  # to be made by each
_LEAST_MOTION = 1e-8  # weight of |dq - pull|² beside the squared error
_SHORTEST = 1e-5  # of the screw
_SOFTNESS = 30.0  # a joint takes at most 30 ds of its way to a limit in a step of the share ds …
_MARGIN = 1e-3  # rad or m; … to a limit that is drawn in by so much; both only while that suffices
_INSIDE = 1e-6  # rad or m; room for a curve between points that lie at a limit
_GROWTH = 1.5
_LATE = 0.02  # of the screw; so near to its end a goal that is still far away is another branch's


@dataclass(frozen=True, eq=False)
class ScrewMotion:
    """X(s) = X_W0 exp(s log(X_W0⁻¹ X_W1)), by dual quaternions; s from 0 to 1."""

    X_W0: pin.SE3
    X_W1: pin.SE3

    def pose(self, s: float) -> pin.SE3:
        """X(s)."""
        return (self._start * DualQuaternion.exp(s * self._twist)).pose()

    @cached_property
    def _start(self) -> DualQuaternion:
        return DualQuaternion.from_pose(self.X_W0)

    @cached_property
    def _twist(self) -> Array:
        return (self._start.conjugate * DualQuaternion.from_pose(self.X_W1)).log()


@dataclass(frozen=True, eq=False)
class SteppedPath:
    """Configurations on the screw: `s` (k,) from 0 on and `Q` (k, n), rad or m; `programs` were solved.

    `blocked` is the joint that keeps the arm from going on, if a joint does.
    """

    s: Array
    Q: Array
    programs: int
    blocked: int | None = None

    @property
    def complete(self) -> bool:
        """Whether it leads to the end of the screw."""
        return bool(self.s[-1] == 1.0)


class ScrewStepper:
    """Steps along one screw; a redundant arm is led to `goal` (n,)."""

    def __init__(self, tool: ScrewTool, screw: ScrewMotion, options: SclerpOptions, goal: Array | None = None) -> None:
        self.tool, self.screw, self.goal, self.tau = tool, screw, goal, options.tau
        self.low, self.high = tool.robot.limits.lower, tool.robot.limits.upper
        velocity = tool.robot.limits.velocity
        self.longest = options.step * velocity / velocity.max()
        self.programs = 0

    def step_along(self, start: Array, most: int, stop: Callable[[], bool] = lambda: False) -> SteppedPath:
        """Step from start (n,), at X(0), at most so many times; a failed step is repeated with half its length."""
        s, ds, S, Q = 0.0, self.tau, [0.0], [np.array(start, float)]
        while s < 1.0 and ds >= _SHORTEST and len(S) <= most and not stop():
            end = 1.0 if s + 1.001 * ds >= 1.0 else s + ds
            q = self._step(Q[-1], s, end)
            if q is None:
                ds *= 0.5
                continue
            s = end
            S.append(s)
            Q.append(q)
            ds = min(self.tau, _GROWTH * ds)
        blocked = self._blocking(Q[-1], s) if s < 1.0 and ds < _SHORTEST else None
        return SteppedPath(np.array(S), np.array(Q), self.programs, blocked)

    def reach(self, s: float, q: Array, bounds: tuple[Array, Array], pull: Array | None = None) -> Array | None:
        """Return the configuration near q (n,) within `bounds` with the tool at X(s); None if there is none so near.

        Each correction dq minimises |J_s dq - e|² + 1e-8 |dq - pull|² within the bounds, with the missing spatial twist
        e = log(X(s) X_WT⁻¹). Only the first correction has a `pull`, so it acts only in directions that keep the tool
        in place.
        """
        low, high = bounds
        target = self.screw.pose(s)
        before = np.inf
        for k in range(_CORRECTIONS):
            X_WT, J = self.tool.at(q)
            e = pin.log6(target * X_WT.inverse()).vector
            error = float(np.abs(e).max())
            if error < _CLOSE:
                return q
            if error > _PROGRESS * before:
                return None
            before = error
            towards = pull if pull is not None and k == 0 else np.zeros(len(q))
            q = np.clip(q + bounded_least_squares(J, e, (low - q, high - q), towards, _LEAST_MOTION), low, high)
            self.programs += 1
        return None

    def inside(self) -> tuple[Array, Array]:
        """The joint limits, drawn in by 1e-6 rad or m."""
        slack = np.minimum(_INSIDE, 0.25 * (self.high - self.low))
        return self.low + slack, self.high - slack

    def _step(self, q: Array, s: float, end: float) -> Array | None:
        pull = None
        if self.goal is not None:
            way = self.goal - q
            if end == 1.0 and (np.abs(way) <= self.longest).all():
                return self.reach(1.0, self.goal, (self.low, self.high))
            pull = way * (end - s) / (1.0 - s)
            if (np.abs(pull) > self.longest).any() and s < 1.0 - _LATE:
                return None
        for bounds in (self._soft_bounds(q, end - s), self._bounds(q)):
            new = self.reach(end, q, bounds, pull)
            if new is not None:
                return new
        return None

    def _bounds(self, q: Array) -> tuple[Array, Array]:
        """Return the bounds of a step from q (n,): within the joint limits, no joint faster than its share."""
        low, high = self.inside()
        return np.minimum(q, np.maximum(low, q - self.longest)), np.maximum(q, np.minimum(high, q + self.longest))

    def _soft_bounds(self, q: Array, ds: float) -> tuple[Array, Array]:
        """Return bounds approached ever more slowly, so that joints do not stop at their limits with a jerk."""
        share = -np.expm1(-_SOFTNESS * ds)
        low = q - share * np.maximum(q - self.low - _MARGIN, 0.0)
        high = q + share * np.maximum(self.high - _MARGIN - q, 0.0)
        return np.maximum(low, q - self.longest), np.minimum(high, q + self.longest)

    def _blocking(self, q: Array, s: float) -> int | None:
        """Return the joint that the next step, without limits, would carry farthest past its limit."""
        free = np.full(len(q), 0.5)
        X_WT, J = self.tool.at(q)
        e = pin.log6(self.screw.pose(min(1.0, s + _SHORTEST)) * X_WT.inverse()).vector
        step = bounded_least_squares(J, e, (-free, free), np.zeros(len(q)), _LEAST_MOTION)
        low, high = self.inside()
        beyond = np.maximum(low - (q + step), q + step - high)
        j = int(np.argmax(beyond))
        return j if beyond[j] > 0.0 else None
