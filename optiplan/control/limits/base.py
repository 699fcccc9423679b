"""`ControlLimit`: a limit of the robot's motion as the controller's program takes it."""

from typing import ClassVar

import numpy as np

from optiplan.arrays import Array
from optiplan.errors import described, wrong_argument
from optiplan.robot.robot import Robot


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
