"""`ToolSpeedLimit`: how fast a frame moves and turns."""

import math
from typing import ClassVar

import numpy as np

from optiplan._core import core
from optiplan.arrays import Array
from optiplan.control.arguments import frame_index, positive_vector
from optiplan.control.configuration import Configuration
from optiplan.control.limits.row_limit import LimitRows, RowLimit
from optiplan.errors import wrong_argument
from optiplan.robot.robot import Robot
from optiplan.trajectory.state import State

_AHEAD = 0.97
"""Share of the speed that the box inside the ball of speeds has along the present motion; across it has the rest."""
_ACROSS = float(np.sqrt(0.5 * (1.0 - _AHEAD**2)))


class ToolSpeedLimit(RowLimit):
    """Speed of a frame's origin, and its angular speed, at most as given.

    A ball is no row: a box inside it is kept, whose long axis lies along the present motion, so that 97 % of the speed
    can be used straight on. The Jacobian is taken for the end of the step.

    Args:
        frame: its name; None: the robot's tool frame.
        linear: m/s; `angular`: rad/s; None: no such limit.

    Raises:
        InputError: neither speed, or one that is not > 0.
    """

    name: ClassVar[str] = "tool speed"

    def __init__(self, frame: str | None = None, linear: float | None = None, angular: float | None = None) -> None:
        self.frame = frame
        if linear is None and angular is None:
            raise wrong_argument("ToolSpeedLimit", "linear", "None", "a speed, linear or angular")
        self._starts: list[int] = []
        self._kinds: list[str] = []
        bounds: list[float] = []
        for argument, value, first in (("linear", linear, 0), ("angular", angular, 3)):
            if value is not None:
                speed = float(positive_vector(self, argument, value, 1)[0])
                self._starts.append(first)
                self._kinds += [argument] * 3
                bounds += [speed * _AHEAD, speed * _ACROSS, speed * _ACROSS]
        self._bounds = np.array(bounds)

    def bind(self, robot: Robot) -> None:
        """Find the frame."""
        name = robot.tool_frame if self.frame is None else self.frame
        self._frame = frame_index(self, "frame", robot, name)
        self._labels = tuple(f"{kind} speed of {name}" for kind in self._kinds)

    def rows(self, c: Configuration, state: State, dt: float) -> LimitRows:
        """Three rows for each speed."""
        rate, J = c.jacobian_rate(self._frame), c.jacobian(self._frame)
        if core is not None:
            return core.speed_rows(J, rate, state.v, dt, self.delay, self._bounds, self._starts, self._labels)
        J = J + dt * rate
        moves = J @ state.v
        G = np.empty((len(self._bounds), len(state.v)))
        for k, first in enumerate(self._starts):
            part = slice(first, first + 3)
            np.dot(_frame_along(moves[part]), J[part], out=G[3 * k : 3 * k + 3])
        return self.speed_rows(G, self._bounds, state, dt, self._labels)


def _frame_along(motion: Array) -> Array:
    """An orthonormal basis (3, 3), in rows, whose first vector lies along a motion (3,)."""
    x, y, z = motion.tolist()
    size = math.sqrt(x * x + y * y + z * z)
    if size < 1e-9:
        return np.eye(3)
    x, y, z = x / size, y / size, z / size
    # Duff et al., Building an Orthonormal Basis, Revisited, JCGT 2017: no direction in which it loses digits.
    sign = math.copysign(1.0, z)
    p = -1.0 / (sign + z)
    q = x * y * p
    return np.array([[x, y, z], [1.0 + sign * x * x * p, sign * q, -sign * x], [q, sign + y * y * p, -y]])
