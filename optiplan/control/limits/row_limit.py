"""`RowLimit`: a limit of the robot's motion that is rows of the velocities at the end of a step."""

import numpy as np

from optiplan.arrays import Array
from optiplan.control.configuration import Configuration
from optiplan.control.limits.base import ControlLimit
from optiplan.control.limits.joint_box import JointBox
from optiplan.records import dataclass
from optiplan.trajectory.state import State


@dataclass(slots=True, eq=False)
class LimitRows:
    """Rows low <= G x <= high of the velocities x (n,) at the end of a step, one limit's; the core has its own.

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

    def __len__(self) -> int:
        """Number of rows."""
        return len(self.low)

    @classmethod
    def normalised(cls, G: Array, low: Array, high: Array, labels: tuple[str, ...], least: float = 1e-9) -> "LimitRows":
        """Return rows of any size divided by it; smaller ones than `least` by that."""
        unit = np.maximum(np.sqrt(np.einsum("ij,ij->i", G, G)), least)
        return cls(G / unit[:, None], low / unit, high / unit, unit, labels)


class RowLimit(ControlLimit):
    """A limit that is rows of the velocities at the end of the step.

    Attributes:
        delay: (n,), s, in which a joint's acceleration comes from its limit to zero.
    """

    delay: Array

    def meet(self, box: JointBox, by_acceleration: bool) -> None:
        """Take from the controller how the joints brake, and whether its form is `acceleration`."""
        self.delay = box.delay

    def rows(self, c: Configuration, state: State, dt: float) -> LimitRows:
        """The rows at a configuration; as many in every step."""
        raise NotImplementedError

    def speed_rows(self, G: Array, high: Array, state: State, dt: float, labels: tuple[str, ...]) -> LimitRows:
        """Rows |G (x + delay · a)| <= high, a = (x - v) / dt: speeds approached so slowly that they can be kept."""
        late = self.delay / dt
        held = G @ (late * state.v)
        return LimitRows.normalised(G * (1.0 + late), held - high, held + high, labels)


class KeptRowLimit(RowLimit):
    """A limit that is rows of the next velocities, and has to hold while the robot brakes from there, too."""

    def keeps(self, state: State, dt: float) -> bool:
        """Whether it holds from a state on, if the robot brakes, or was broken already."""
        raise NotImplementedError
