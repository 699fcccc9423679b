"""`ControlLimit`: a limit of the robot's motion as the controller's program takes it."""

from typing import ClassVar

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
