"""What every controller of a closed loop gives."""

from typing import Protocol

from optiplan.arrays import Array
from optiplan.control.step import ControlStep
from optiplan.records import dataclass
from optiplan.simulation.plants.base import Input
from optiplan.simulation.references.base import ToolTarget


@dataclass(frozen=True, eq=False, slots=True)
class JointTarget:
    """Joints at the instant of the measurement, and their rates in the middle of the period that the command is held.

    Attributes:
        q: (n,), rad or m, now; `v`: (n,) now.
        ahead_v: (n,) half a period later; `ahead_a`: (n,) likewise. Held over the period they leave no lag.
        ahead_torque: (n,) feed-forward then, N·m (N), of a reference that knows it; else None.
    """

    q: Array
    v: Array
    ahead_v: Array
    ahead_a: Array
    ahead_torque: Array | None = None


@dataclass(frozen=True, eq=False, slots=True)
class Command:
    """Input of the plant for one period.

    Attributes:
        value: (n,), N·m (N) or rad/s (m/s).
        q: (n,), where the joints are wanted now; the log compares with it.
        step: what the task-space controller said, of one.
    """

    value: Array
    q: Array
    step: ControlStep | None = None


class LoopController(Protocol):
    """A controller as the closed loop calls it, once a period."""

    output: Input

    def command(self, q: Array, v: Array, target: JointTarget | ToolTarget) -> Command:
        """The input of the plant, of the measured state (n,) and what is wanted."""
