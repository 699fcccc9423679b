"""`ControlTask`: an error that should go to zero, and its Jacobian."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from optiplan.arrays import Array, is_finite
from optiplan.control.configuration import Configuration
from optiplan.errors import UnknownChoiceError, described, wrong_argument
from optiplan.robot.robot import Robot

Weight = float | Sequence[float] | Array


class ControlTask(ABC):
    """An error e(q), k numbers, that is to vanish at the rate `gain`.

    At the level of velocities the controller asks J v = e_rate with e_rate = -gain · e + (feed-forward), at the level
    of accelerations J a + J̇ v = -gain² e - 2 gain (J v - feed-forward) + (its rate); the weight of each row is `cost`.

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
    scale: Array | None = None
    """(k,), rates of the error that the robot can give, unit/s; where the error is large they cap what is asked."""
    brake: Array | None = None
    """(k,), unit/s²: how quickly the robot can change these rates."""

    def __init__(self, size: int, cost: Weight, gain: float, priority: int) -> None:
        self.size = size
        self.gain = checked_number(self, "gain", gain, 0.0)
        self.cost = cost
        if isinstance(priority, bool) or not isinstance(priority, int) or priority < 0:
            raise wrong_argument(type(self).__name__, "priority", described(priority), "a whole number >= 0")
        self.priority = priority

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
        """E (k,)."""

    @abstractmethod
    def jacobian(self, c: Configuration) -> Array:
        """J (k, n) = de/dq."""

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


def checked_number(owner: object, argument: str, value: object, least: float) -> float:
    """A finite number of at least `least`.

    Raises:
        InputError: it is none.
    """
    if not is_finite(value) or value < least:
        raise wrong_argument(type(owner).__name__, argument, described(value), f"a finite number >= {least:g}")
    return float(value)


def checked_vector(owner: object, argument: str, value: object, size: int, least: float | None = None) -> Array:
    """Numbers (size,), all finite; one number stands for all.

    Raises:
        InputError: other than that.
    """
    expected = f"{size} finite numbers" + ("" if least is None else f" >= {least:g}")
    try:
        vector = np.array(np.broadcast_to(np.asarray(value, dtype=np.float64), (size,)))
    except (TypeError, ValueError):
        raise wrong_argument(type(owner).__name__, argument, described(value), expected) from None
    bad = ~np.isfinite(vector) | (vector < (-np.inf if least is None else least))
    if bad.any():
        k = int(np.flatnonzero(bad)[0])
        raise wrong_argument(type(owner).__name__, f"{argument}[{k}]", f"{vector[k]:g}", expected)
    return vector


def frame_index(owner: object, argument: str, robot: Robot, name: str) -> int:
    """Index of a frame of the robot.

    Raises:
        InputError: there is none of that name.
    """
    try:
        return robot.frame_id(name)
    except UnknownChoiceError as error:
        expected = f"one of: {', '.join(error.choices)}"
        raise wrong_argument(type(owner).__name__, argument, f"'{name}'", expected) from None
