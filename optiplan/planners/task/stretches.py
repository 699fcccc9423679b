"""Steps of a task that are one motion."""

from dataclasses import dataclass

from optiplan.planners.task.chains import PlannedStep
from optiplan.trajectory.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class Stretch:
    """Steps that are one motion of the same joints, or a standstill of so many seconds.

    Attributes:
        done: the steps.
        motion: of the joints of their stage; or seconds.
        ends: when each of the steps ends, s from the beginning.
    """

    done: tuple[PlannedStep, ...]
    motion: Trajectory | float
    ends: tuple[float, ...]

    @classmethod
    def of(cls, done: PlannedStep, motion: Trajectory | float) -> "Stretch":
        """Return a step alone."""
        return cls((done,), motion, (motion.duration if isinstance(motion, Trajectory) else motion,))
