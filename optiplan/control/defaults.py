"""The limits that a controller has where none are given, and the order in which limits are given up."""

from optiplan.control.limits.base import ControlLimit
from optiplan.control.limits.clearance import ClearanceLimit
from optiplan.control.limits.joint_limits import AccelerationLimit, JerkLimit, PositionLimit, VelocityLimit
from optiplan.geometry.scene import Scene

ORDER = (
    "tool speed",
    "wheel speed",
    "torque",
    "half-space",
    "clearance",
    "position",
    "velocity",
    "jerk",
    "acceleration",
)
"""Names of limits, the first given up first. Limits of single joints are kept before all others."""

LONGEST_STEP = 0.1
"""s; longest step of a controller where none is stated."""


def default_limits(scene: Scene | None = None) -> tuple[ControlLimit, ...]:
    """Position, velocity, acceleration and jerk of the joints; with a scene, clearance of at least 5 mm too."""
    joints = PositionLimit(), VelocityLimit(), AccelerationLimit(), JerkLimit()
    return joints if scene is None else (*joints, ClearanceLimit(scene))
