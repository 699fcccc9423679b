"""Joint rates that keep a frame on a tool path, and the correction of deviations.

All norms of joint motion are in z = q / velocity limit, so that rad and m, and slow and fast joints, can be compared:
J_z = J diag(limits). With the pseudo-inverse J_z^+ and N = I - J_z^+ J_z, the motion over the path's parameter s is

    dz/ds = J_z^+ V(s) + N d(s, z),

where V is the twist of the path and d the drift of the redundancy: away from limits and, if there is one, towards a
goal configuration. The second derivative keeps J_z z'' = V' - J' q', so that the tool stays on its path whatever d.
"""

from dataclasses import replace

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.planners.cartesian.tool_path import FollowedPath
from optiplan.problem.constraints.poses import RelativePose
from optiplan.problem.problem import Problem
from optiplan.records import dataclass
from optiplan.robot.robot import Limits, Robot

LIMIT_AVOIDANCES = (4.0, 20.0)
"""Values of `Aim.avoidance` that redundant arms try, in this order."""

_RANK = 1e-9  # share of the largest singular value: smaller ones do not move the frame
_CLOSE = 1e-9  # m and rad: from here one more step of Newton's method leaves rounding only
_STEPS = 8  # of Newton's method
_DIFFERENCE = 1e-4  # step in s of finite differences


@dataclass(frozen=True, eq=False)
class Aim:
    """Use of the redundant degrees of freedom.

    Attributes:
        goal: (n,) configuration to end at, rad or m; None: anywhere.
        avoidance: speed of the drift away from limits, relative to the joint speed along the path.
        orientation: whether the path's orientation counts; its position always does.
        coupled: other frames, which keep their pose in the tool's frame as at the start.
    """

    goal: Array | None = None
    avoidance: float = 4.0
    orientation: bool = True
    coupled: "tuple[CoupledFrame, ...]" = ()


@dataclass(frozen=True, eq=False)
class CoupledFrame:
    """A frame G that keeps its pose X_FG in the frame F that follows the path."""

    frame: str
    X_FG: pin.SE3


class Tracker:
    """Kinematics of a robot's frame along a tool path, within the limits of a problem; one object a thread."""

    def __init__(self, robot: Robot, limits: Limits, frame: str, path: FollowedPath, aim: Aim) -> None:
        self.robot, self.frame, self.path, self.aim = replace(robot, limits=limits), frame, path, aim
        self.scale = limits.velocity
        own = np.arange(6 if aim.orientation else 3)
        self.rows = np.concatenate([own, np.arange(6, 6 + 6 * len(aim.coupled))])
        self.redundant = robot.n > len(self.rows)
        self._model, self._data, self._frame = robot.model, robot.model.createData(), robot.frame_id(frame)
        self._coupled = [(robot.frame_id(one.frame), one.X_FG) for one in aim.coupled]
        self._bounded = np.isfinite(limits.lower) & np.isfinite(limits.upper) & (limits.upper > limits.lower)
        low, high = np.where(self._bounded, limits.lower, -1.0), np.where(self._bounded, limits.upper, 1.0)
        self._middle, self._half = 0.5 * (low + high), 0.5 * (high - low)

    def error(self, s: float, q: Array) -> Array:
        """(6,): p(s) - p(q), m, and the rotation vector from R(q) to R(s), rad, both in world axes; 0 if left free.

        Every coupled frame adds six rows.
        """
        pin.framesForwardKinematics(self._model, self._data, q)
        X, target = self._data.oMf[self._frame], self.path.pose(s)
        angle = pin.log3(target.rotation @ X.rotation.T) if self.aim.orientation else np.zeros(3)
        rows = [target.translation - X.translation, angle]
        for frame, X_FG in self._coupled:
            X, wanted = self._data.oMf[frame], target * X_FG
            rows += [wanted.translation - X.translation, pin.log3(wanted.rotation @ X.rotation.T)]
        return np.concatenate(rows)

    def twist(self, s: float) -> Array:
        """dX/ds of the path and of the coupled frames, without the free rows."""
        own = self.path.twist(s)
        velocity, turning = own[:3], own[3:]
        arms = [part for r in self._arms(s) for part in (velocity + np.cross(turning, r), turning)]
        return np.asarray(np.concatenate([own, *arms])[self.rows])

    def jacobian(self, q: Array) -> Array:
        """J_z (rows, n): twist of the frame and its coupled frames for dz, in world axes, m or rad."""
        reference = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        pin.computeJointJacobians(self._model, self._data, q)
        pin.updateFramePlacements(self._model, self._data)
        frames = [self._frame, *(frame for frame, _ in self._coupled)]
        found = [pin.getFrameJacobian(self._model, self._data, frame, reference).reshape(6, -1) for frame in frames]
        return np.asarray(np.concatenate(found)[self.rows] * self.scale)

    def _arms(self, s: float) -> list[Array]:
        """Vectors from the origin of F to those of the coupled frames, in world axes, m."""
        return [self.path.pose(s).rotation @ X_FG.translation for _, X_FG in self._coupled]

    def _twist_rate(self, s: float) -> Array:
        """d/ds of `twist`; an arm r that turns with w adds w x (w x r)."""
        own, turning = self.path.twist_rate(s), self.path.twist(s)[3:]
        inward = (np.cross(turning, np.cross(turning, r)) for r in self._arms(s))
        return np.asarray(np.concatenate([own, *(part for a in inward for part in (own[:3] + a, own[3:]))])[self.rows])

    def rate(self, s: float, q: Array) -> Array:
        """dq/ds (n,) at q (n,)."""
        inverse, free = self._inverse(q)
        task = inverse @ self.twist(s)
        if not free.any():
            return np.asarray(self.scale * task)
        return np.asarray(self.scale * (task + free @ self._drift(s, q, float(np.linalg.norm(task)))))

    def joint_curvature(self, s: float, q: Array, dq: Array) -> Array:
        """d²q/ds² (n,) along the flow of `rate`, whose value at q is dq (n,).

        The part of the tool is exact; the drift of a redundant arm is differenced along the flow.
        """
        inverse, free = self._inverse(q)
        missing = self._twist_rate(s) - self._acceleration(q, dq)
        if not free.any():
            return np.asarray(self.scale * (inverse @ missing))
        if s == 1.0 and self.aim.goal is not None:  # see `arrive`
            return np.asarray(self.scale * (inverse @ missing))
        low, high = max(0.0, s - _DIFFERENCE), min(1.0, s + _DIFFERENCE)
        ahead, behind = (self.rate(x, q + (x - s) * dq) for x in (high, low))
        flow = (ahead - behind) / (self.scale * (high - low))
        return np.asarray(self.scale * (inverse @ missing + free @ flow))

    def arrive(self, q: Array, dq: Array) -> Array:
        """dq/ds (n,) at s = 1 with the null-space part of dq (n,): there `rate` would divide 0 by 0 at the goal."""
        inverse, free = self._inverse(q)
        return np.asarray(self.scale * (inverse @ self.twist(1.0) + free @ (dq / self.scale)))

    def correct(self, s: float, q: Array) -> Array | None:
        """The configuration near q (n,) with the tool at X(s), by Newton's method; None if it does not converge."""
        for _ in range(_STEPS):
            error = self.error(s, q)
            q = q + self.scale * (self._inverse(q)[0] @ error[self.rows])
            if np.abs(error).max() < _CLOSE:
                return q
        return None

    def _inverse(self, q: Array) -> tuple[Array, Array]:
        """J_z^+ (n, rows) and N (n, n); N is 0 where nothing is free."""
        U, sigma, Vt = np.linalg.svd(self.jacobian(q), full_matrices=False)
        kept = sigma > _RANK * sigma[0]
        U, sigma, Vt = U[:, kept], sigma[kept], Vt[kept]
        n = Vt.shape[1]
        free = self.redundant and bool(kept.all())
        return (Vt.T / sigma) @ U.T, np.eye(n) - Vt.T @ Vt if free else np.zeros((n, n))

    def _acceleration(self, q: Array, dq: Array) -> Array:
        """J' q': how the twist of the frame changes at constant joint rates, in world axes."""
        pin.forwardKinematics(self._model, self._data, q, dq, np.zeros(len(q)))
        reference = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        frames = [self._frame, *(frame for frame, _ in self._coupled)]
        bias = [pin.getFrameClassicalAcceleration(self._model, self._data, one, reference).vector for one in frames]
        return np.asarray(np.concatenate(bias)[self.rows])

    def _drift(self, s: float, q: Array, speed: float) -> Array:
        """Return the drift (n,): -speed * avoidance * x^5 with x = ±1 at the limits, and the remaining way over 1 - s.

        The first part is the negative gradient in z of sum_j (h_j / v_j) x_j^6 / 6, h half the range, v the velocity
        limit. It fades out as the goal comes near.
        """
        x = np.where(self._bounded, np.clip((q - self._middle) / self._half, -1.0, 1.0), 0.0)
        away = -speed * self.aim.avoidance * x**5
        if self.aim.goal is None:
            return np.asarray(away)
        left = max(1.0 - s, _DIFFERENCE)
        return np.asarray((self.aim.goal - q) / (self.scale * left) + left**2 * away)


def coupled_frames(problem: Problem, frame: str) -> tuple[CoupledFrame, ...]:
    """Return the frames whose start pose in a frame is held by path constraints."""
    model, found = problem.robot.model, []
    data = model.createData()
    pin.framesForwardKinematics(model, data, problem.start)
    X_WF = data.oMf[problem.robot.frame_id(frame)]
    for one in problem.path_constraints:
        if isinstance(one, RelativePose) and frame in (one.frame, one.to):
            other = one.to if frame == one.frame else one.frame
            found.append(CoupledFrame(other, X_WF.actInv(data.oMf[problem.robot.frame_id(other)])))
    return tuple(found)
