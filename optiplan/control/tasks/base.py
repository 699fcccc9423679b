"""`ControlTask`: an error that should go to zero, and its Jacobian."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from optiplan._core import core
from optiplan.arrays import Array
from optiplan.control.arguments import checked_number, checked_vector, frame_index
from optiplan.control.configuration import Configuration
from optiplan.control.tasks.tool_abilities import Ability, default_gain, tool_abilities
from optiplan.errors import whole_argument
from optiplan.robot.robot import Robot
from optiplan.trajectory.state import State

Weight = float | Sequence[float] | Array


class ControlTask(ABC):
    """An error e(q), k numbers, that is to vanish at the rate `gain`.

    At the level of velocities the controller asks J v = e_rate with e_rate = -gain · e + (feed-forward), at the level
    of accelerations J a + J̇ v = 4 max(gain, 1) (e_rate - J v) - gain (J v - feed-forward) + (its rate); the weight of
    each row is `cost`.

    Args:
        cost: weight of each of the k rows, or one for all, per unit of the error.
        gain: 1/s; the error falls by a factor e in 1/gain.
        priority: tasks of a lower number come first, strictly; those of one number are weighed against each other.

    Raises:
        InputError: a value that cannot be.
    """

    size: int
    name: ClassVar[str] = "task"
    components: ClassVar[tuple[str, ...]] = ()
    """Names of the rows of the error; empty: numbers, or the joints where `by_joint` is set."""
    by_joint: ClassVar[bool] = False
    """Whether each row is about one joint, in the robot's order."""

    def __init__(self, size: int, cost: Weight, gain: float, priority: int) -> None:
        self.size = size
        self.gain = gain
        self.cost = cost
        whole_argument(type(self).__name__, "priority", priority, 0)
        self.priority = priority

    @property
    def gain(self) -> float:
        """1/s, >= 0."""
        return self._gain

    @gain.setter
    def gain(self, value: float) -> None:
        self._gain = checked_number(self, "gain", value, 0.0)

    @property
    def cost(self) -> Array:
        """Weights (k,) of the rows."""
        return self._cost

    @cost.setter
    def cost(self, value: Weight) -> None:
        self._cost = checked_vector(self, "cost", value, self.size, least=0.0)

    def row_names(self, joints: Sequence[str]) -> tuple[str, ...]:
        """Return a name for each of the k rows: the task, its frame if it has one, and the component."""
        frame = getattr(self, "frame", None)
        title = f"{self.name} of {frame}" if isinstance(frame, str) else self.name
        numbers = [str(k) for k in range(self.size)]
        rows = joints if self.by_joint else self.components or numbers
        return tuple(f"{title}: {row}" for row in rows)

    def bind(self, robot: Robot) -> None:
        """Look up what the task names in the robot; the controller calls it once.

        Raises:
            InputError: the robot has no such frame or joint, or a vector is of another size.
        """
        return

    @abstractmethod
    def error(self, c: Configuration) -> Array:
        """Return the error e (k,), in the units of the components."""

    @abstractmethod
    def jacobian(self, c: Configuration) -> Array:
        """J (k, n) = de/dq."""

    def begin_step(self, state: State, dt: float) -> None:
        """Take note that a step of dt s begins in a state: for targets that move."""
        return

    def evaluate(self, c: Configuration) -> tuple[Array, Array]:
        """Error (k,) and Jacobian (k, n) together, where that is cheaper."""
        return self.error(c), self.jacobian(c)

    def feed_forward(self, c: Configuration) -> Array | None:
        """Rates (k,) at which the robot has to move for the error to stay as it is, unit/s; None: zeros."""
        return None

    def feed_forward_rate(self, c: Configuration) -> Array | None:
        """Rate of change (k,) of the feed-forward, unit/s²; None: zeros."""
        return None

    def drift(self, c: Configuration) -> Array | None:
        """J̇ v (k,), unit/s²; None where that takes more than differences of J."""
        return None

    def wanted_rate(self, e: Array) -> Array:
        """-gain e, capped where e is large so that the robot can slow down in time, (k,)."""
        return -self.gain * e

    def __repr__(self) -> str:
        """Name and weights."""
        return f"{type(self).__name__}(cost={np.unique(self.cost).tolist()}, gain={self.gain:g})"


class MovedFrameTask(ControlTask):
    """A task that moves a frame F of the robot, no faster than the robot's joints can where no gain is given.

    Attributes:
        frame: name of F.
    """

    def __init__(self, frame: str, size: int, cost: Weight, gain: float | None, priority: int) -> None:
        super().__init__(size, cost, 0.0 if gain is None else gain, priority)
        self._has_gain, self._is_curbed = gain is not None, gain is None
        self.frame, self._frame = frame, -1
        self._take_abilities(Ability(), Ability())

    def bind(self, robot: Robot) -> None:
        """Find F, and how quickly the robot moves it."""
        self._frame = frame_index(self, "frame", robot, self.frame)
        if not self._has_gain:
            self._gain = default_gain(robot)
        if self._is_curbed:
            self._take_abilities(*tool_abilities(robot, self.frame))

    @property
    def gain(self) -> float:
        """1/s, >= 0; one that is set stays for later controllers."""
        return self._gain

    @gain.setter
    def gain(self, value: float) -> None:
        self._gain, self._has_gain = checked_number(self, "gain", value, 0.0), True

    def _take_abilities(self, moves: Ability, turns: Ability) -> None:
        self._moves, self._turns, self._abilities = moves, turns, np.array([*moves, *turns])

    def _pose_rate(self, e: Array) -> Array:
        """Rates (6,) for the error of a pose: metres and radians each within what the robot's joints give."""
        if core is not None:
            return core.capped(e, self.gain, self._abilities)
        rates = np.empty(6)
        rates[:3] = capped(e[:3], self.gain, *self._moves)
        rates[3:] = capped(e[3:], self.gain, *self._turns)
        return rates


def capped(e: Array, gain: float, speed: float, brake: float) -> Array:
    """-gain e for a vector e, slower where |e| is large: sqrt(2 brake (|e| - brake / (2 gain²))), at most `speed`.

    Whoever slows down by `brake` all the way comes to rest where e = 0, and the two laws join smoothly at
    |e| = brake / gain².
    """
    size = float(e @ e) ** 0.5
    wanted = gain * size
    if gain * wanted > brake:
        wanted = (2.0 * brake * (size - 0.5 * brake / gain**2)) ** 0.5
    if wanted > speed:
        wanted = speed
    return e * (-wanted / size) if size > 0.0 else -e
