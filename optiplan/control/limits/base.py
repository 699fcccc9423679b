"""`ControlLimit`: a limit of the robot's motion as the controller's program takes it; rows that bound velocities."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from optiplan.arrays import Array
from optiplan.control.configuration import Configuration
from optiplan.errors import described, wrong_argument
from optiplan.robot.robot import Robot
from optiplan.trajectory.state import State

if TYPE_CHECKING:
    from optiplan.control.limits.joint_box import JointBox


@dataclass(frozen=True, slots=True, eq=False)
class LimitRows:
    """Rows low <= G x <= high of the velocities x (n,) at the end of a step, one limit's.

    Attributes:
        G: (k, n), rows of about unit size.
        low: (k,), `high`: (k,); infinite where a row has one side.
        unit: (k,), what a row was divided by: G x times it is in the limit's own units.
        labels: (k,), what each row is about.
    """

    G: Array
    low: Array
    high: Array
    unit: Array
    labels: tuple[str, ...]


class ControlLimit:
    """A limit with a `name` under which it is relaxed, and reported."""

    name: ClassVar[str] = "limit"

    def bind(self, robot: Robot) -> None:
        """Look up in the robot what the limit names; the controller calls it once.

        Raises:
            InputError: there is no such thing, or a vector is of another size.
        """
        return

    def __repr__(self) -> str:
        """Its name."""
        return f"{type(self).__name__}()"


class RowLimit(ControlLimit):
    """A limit that is rows of the velocities at the end of the step.

    Attributes:
        delay: (n,), s, in which a joint's acceleration comes from its limit to zero.
    """

    delay: Array

    def meet(self, box: "JointBox", by_acceleration: bool) -> None:
        """Take from the controller how the joints brake, and whether its form is `acceleration`."""
        self.delay = box.delay

    def rows(self, c: Configuration, state: State, dt: float) -> LimitRows:
        """The rows at a configuration; as many in every step."""
        raise NotImplementedError

    def speed_rows(self, G: Array, high: Array, state: State, dt: float, labels: tuple[str, ...]) -> LimitRows:
        """Rows |G (x + delay · a)| <= high, a = (x - v) / dt: speeds approached so slowly that they can be kept."""
        late = self.delay / dt
        held = G @ (late * state.v)
        ahead = G * (1.0 + late)
        unit = np.maximum(np.sqrt(np.einsum("ij,ij->i", ahead, ahead)), 1e-9)
        return LimitRows(ahead / unit[:, None], (held - high) / unit, (held + high) / unit, unit, labels)


class KeptRowLimit(RowLimit):
    """A limit that is rows of the next velocities, and has to hold while the robot brakes from there, too."""

    def keeps(self, state: State, dt: float) -> bool:
        """Whether it holds from a state on, if the robot brakes, or was broken already."""
        raise NotImplementedError


def positive_vector(owner: object, argument: str, value: object, size: int) -> Array:
    """Numbers > 0 (size,), of which infinity is one; one number stands for all.

    Raises:
        InputError: other than that.
    """
    expected = f"{size} numbers > 0"
    try:
        vector = np.array(np.broadcast_to(np.asarray(value, dtype=np.float64), (size,)))
    except (TypeError, ValueError):
        raise wrong_argument(type(owner).__name__, argument, described(value), expected) from None
    bad = np.flatnonzero(~(vector > 0.0))
    if len(bad):
        raise wrong_argument(type(owner).__name__, f"{argument}[{bad[0]}]", f"{vector[bad[0]]:g}", expected)
    return vector
