"""`WheelSpeedLimit`: rates of the wheels of a base on mecanum wheels, kept while it drives and while it brakes."""

from typing import ClassVar

import numpy as np

from optiplan.arrays import Array
from optiplan.control.arguments import positive_vector
from optiplan.control.braking_path import FINEST, make_braking_path
from optiplan.control.configuration import Configuration
from optiplan.control.limits.joint_box import JointBox
from optiplan.control.limits.row_limit import KeptRowLimit, LimitRows
from optiplan.errors import wrong_argument
from optiplan.kinematics.mecanum import WHEELS, Mecanum
from optiplan.robot.robot import Robot
from optiplan.trajectory.state import State

_ROUNDING = 1e-9
"""rad/s; what rounding may cost."""
_RESERVE = 5e-3
"""Share of a rate that rows leave free, for what happens between the moments that they look at."""
_MOMENTS = np.array([0.05, 0.2, 0.35, 0.55, 0.8, 1.5])
"""When rows look at the wheels, after the step: in shares of the time that turning an acceleration back takes."""


class WheelSpeedLimit(KeptRowLimit):
    """|wheel rates| <= rate, rad/s, in every step and in the stop from there, in which the base may still turn.

    With a heading ψ and velocities V of the base, wheel rates are M Rz(ψ)ᵀ V: at a constant velocity they change as the
    base turns, and jerk limits keep it from braking at once. So rows look ahead: at moments of the stop after a step
    with velocities x, positions and velocities are interpolated between those for the ends of the bounds of x, which
    lie close to each other. That a whole stop keeps the rates is measured, step by step, before x is commanded.

    Args:
        rate: of each of the four wheels, or one for all, rad/s.
    """

    name: ClassVar[str] = "wheel speed"

    def __init__(self, rate: object) -> None:
        self._rate = positive_vector(self, "rate", rate, len(WHEELS))

    def bind(self, robot: Robot) -> None:
        """Ask whether the robot has wheels, and find the joints of its base."""
        spec = robot.mecanum
        if spec is None:
            expected = "a robot whose file has `mecanum`"
            raise wrong_argument("WheelSpeedLimit", "robot", f"'{robot.name}', which has no wheels", expected)
        self._robot = robot
        self._columns = [robot.joint_names.index(name) for name in spec.joints]
        self._matrix = Mecanum(spec.radius, spec.half_wheelbase, spec.half_track).matrix
        self._allowed = self._rate
        self._labels = tuple(f"wheel {name}" for _ in _MOMENTS for name in WHEELS)

    def meet(self, box: JointBox, by_acceleration: bool) -> None:
        """Take how the joints brake."""
        super().meet(box, by_acceleration)
        self._box, self._mean = box, by_acceleration
        self._path = make_braking_path(self._robot)

    def rows(self, c: Configuration, state: State, dt: float) -> LimitRows:
        """A row for each wheel at each moment."""
        columns, n = self._columns, state.n
        self._brakes = self._box.brakes_of(columns)
        self._allowed = np.maximum(self._rate, self._worst(state, dt))
        q, v = state.q[columns], state.v[columns]
        self._moments = np.rint(_MOMENTS * (self._box.delay[columns].max() / min(dt, FINEST))).astype(np.int64)
        first, last = self._box.low[columns], self._box.high[columns]
        bounded = np.isfinite(last - first)
        first = np.where(bounded, first, v)
        last = np.where(bounded, np.maximum(last, first + 1e-6), v + 1e-3)
        ends = [self._stop(q, v, x, dt) for x in (first, last)]
        (q_0, V_0), (q_1, V_1) = ends
        slope, turn = (V_1 - V_0) / (last - first), (q_1 - q_0)[:, 2] / (last - first)[2]
        yaw, x, V = 0.5 * (q_0 + q_1)[:, 2], 0.5 * (first + last), 0.5 * (V_0 + V_1)
        W = self._matrix @ _headings(yaw)  # (moments, 4, 3)
        change = W * slope[:, None]
        # A base that turns faster is turned farther: d Rz(yaw)ᵀ / d yaw is Rz(yaw + π/2)ᵀ, but for the turn itself.
        V_xy = V * [1.0, 1.0, 0.0]
        change[:, :, 2] += np.einsum("mwj,mj->mw", self._matrix @ _headings(yaw + 0.5 * np.pi), V_xy) * turn[:, None]
        still = (np.einsum("mwj,mj->mw", W, V) - change @ x).ravel()
        G = np.zeros((len(still), n))
        G[:, columns] = change.reshape(-1, 3)
        rate, braking = np.tile((1.0 - _RESERVE) * self._rate, len(_MOMENTS)), G @ self._box.slowing
        low = np.minimum(-rate - still, braking - _ROUNDING)  # what braking does is never forbidden
        high = np.maximum(rate - still, braking + _ROUNDING)
        return LimitRows.normalised(G, low, high, self._labels)

    def _stop(self, q: Array, v: Array, x: Array, dt: float) -> tuple[Array, Array]:
        """Positions and velocities (moments, 3) of the base in the stop after a step with velocities x."""
        step = 0.5 * (v + x) if self._mean else x
        self._path.start(q + dt * step, x, (x - v) / dt, self._brakes, dt)
        return self._path.motion(self._moments)

    def keeps(self, state: State, dt: float) -> bool:
        """Whether the wheels keep their rates, or those that cannot be helped, from a state on if the base brakes."""
        return bool((self._worst(state, dt) <= self._allowed + _ROUNDING).all())

    def _worst(self, state: State, dt: float) -> Array:
        """The largest rates (4,) from a state until the base stands, rad/s; or less than is allowed, roughly."""
        columns = self._columns
        v, a = state.v[columns], np.abs(state.a[columns])
        # At whatever heading, and at the highest velocities: until the acceleration is turned back, a²/2j is gained.
        most = np.abs(v) + a * (0.5 * a / self._brakes.jerk + dt)
        turned = np.array([np.hypot(most[0], most[1])] * 2 + [most[2]])
        rough = np.abs(self._matrix) @ turned
        if (rough <= self._rate).all():
            return np.asarray(rough)
        self._path.start(state.q[columns], v, state.a[columns], self._brakes, dt)
        q, V = self._path.motion(np.arange(self._path.steps + 1))
        rates = np.zeros(len(WHEELS))
        for heading in (q[:, 2], q[:, 2] - dt * V[:, 2]):  # at the end and at the beginning of each step
            c, s = np.cos(heading), np.sin(heading)
            twists = np.column_stack([c * V[:, 0] + s * V[:, 1], c * V[:, 1] - s * V[:, 0], V[:, 2]])
            rates = np.maximum(rates, np.abs(twists @ self._matrix.T).max(axis=0))
        return rates


def _headings(yaw: Array) -> Array:
    """diag(Rz(yaw)ᵀ, 1), (k, 3, 3)."""
    R = np.zeros((len(yaw), 3, 3))
    c, s = np.cos(yaw), np.sin(yaw)
    R[:, 0, 0] = R[:, 1, 1] = c
    R[:, 0, 1], R[:, 1, 0], R[:, 2, 2] = s, -s, 1.0
    return R
