"""`ClearanceLimit`: bodies of the robot, of what it holds and of the scene stay apart."""

from collections.abc import Callable
from typing import ClassVar

import numpy as np

from optiplan.arrays import Array, Index
from optiplan.collision.model import CollisionModel
from optiplan.control.configuration import Configuration
from optiplan.control.limits.stop_limits import StopLimit
from optiplan.control.tasks.base import checked_number
from optiplan.errors import described, wrong_argument
from optiplan.geometry.scene import Scene
from optiplan.robot.robot import Robot

AT_LEAST = 0.005
"""m; kept where no other distance is given: what planners aim at."""


class ClearanceLimit(StopLimit):
    """Distances of all pairs that a problem would check: links, attached objects, obstacles; see `StopLimit`.

    Distances are asked of coal only for pairs that the travel since their last query may have brought near.

    Args:
        scene: obstacles, attached objects, allowed contacts; None: the robot alone.
        at_least: m.
        influence: m; pairs farther apart are no rows.
        rate: 1/s; how quickly a distance may shrink, as a share of itself: rate · influence should be no less than the
            largest speed of the robot's bodies, or they brake hard when they come into view.

    Raises:
        InputError: a distance that is not > 0, no scene.
    """

    name: ClassVar[str] = "clearance"

    def __init__(
        self, scene: Scene | None = None, at_least: float = AT_LEAST, influence: float = 0.05, rate: float = 50.0
    ) -> None:
        if scene is not None and not isinstance(scene, Scene):
            raise wrong_argument("ClearanceLimit", "scene", described(scene), "an op.Scene")
        self.scene = Scene() if scene is None else scene
        self.at_least = checked_number(self, "at_least", at_least, 0.0)
        self.influence = self.at_least + checked_number(self, "influence", influence, 1e-4)
        self.rate = checked_number(self, "rate", rate, 1e-3)

    def bind(self, robot: Robot) -> None:
        """Make the bodies, and bounds of how far joints move them."""
        self.model = CollisionModel(robot, self.scene)
        limits = robot.limits
        stroke = np.maximum(np.abs(limits.lower), np.abs(limits.upper))
        self.arms = self.model.bounds.moment_arms(np.where(np.isfinite(stroke), stroke, np.pi))
        self.labels = tuple(f"{pair.name_a} and {pair.name_b}" for pair in self.model.pairs)
        self._fold = self.model.bounds.kinematics

    def distances(self, c: Configuration, which: Index) -> tuple[Array, Callable[[], Array]]:
        """Distances, m, negative where bodies overlap; meshes that overlap are measured by their hulls."""
        found, vectors = self.model.nearest(c.data, which)

        def gradients() -> Array:
            """N . (J_b - J_a) of the witness points: with the spatial Jacobian J, (J_v + J_w × p) · n = J · (n, p × n)."""
            normals, J = vectors[:, 2], c.joint_jacobians()
            moves = self.model.bounds.moves[which]
            sides = [
                (np.hstack([normals, _cross(vectors[:, side], normals)]) @ J) * moves[:, side] for side in (0, 1)
            ]
            return self._fold.planned_bound(sides[1] - sides[0])

        return found, gradients


def _cross(a: Array, b: Array) -> Array:
    """Row by row; numpy's own takes ten times longer on a few rows."""
    result = np.empty_like(a)
    result[:, 0] = a[:, 1] * b[:, 2] - a[:, 2] * b[:, 1]
    result[:, 1] = a[:, 2] * b[:, 0] - a[:, 0] * b[:, 2]
    result[:, 2] = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    return result


