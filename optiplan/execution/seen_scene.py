"""The scene as it was seen while a robot moves, and what of it blocks the rest of the path."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from optiplan.arrays import is_finite
from optiplan.execution.arguments import numbers, told
from optiplan.execution.proved_path import PathStretch, ProvedPath
from optiplan.execution.scene_watch import BlockedPlace, SceneWatch, SeenObstacle
from optiplan.geometry.pose import Pose, Values

if TYPE_CHECKING:
    from optiplan._core._core_base import TimeLaw


class SeenScene:
    """What `Executor.update_scene` was told, about one path.

    Args:
        path: its run gives the robot and the obstacles that are known.
        clearance: distance to keep from obstacles that moved, m.
    """

    def __init__(self, path: ProvedPath, clearance: float) -> None:
        self._watch, self._clearance = SceneWatch(path, clearance), clearance
        self._obstacles: dict[str, SeenObstacle] = {}

    def see(self, poses: Mapping[str, Pose], velocities: Mapping[str, Values], spread: float, time: float) -> str:
        """Remember where obstacles are at a time, s; return why that is not possible, or nothing."""
        known = {obstacle.name for obstacle in self._watch.scene.obstacles}
        if not isinstance(poses, Mapping) or not all(isinstance(pose, Pose) for pose in poses.values()):
            return f"update_scene: found {told(poses)}; expected poses by name"
        if not is_finite(spread) or spread < 0.0:
            return f"update_scene: found a spread of {told(spread)}; expected a speed >= 0, m/s"
        if not isinstance(velocities, Mapping):
            return f"update_scene: found {told(velocities)}; expected velocities by name"
        for name, pose in poses.items():
            if name not in known:
                return f"update_scene: found an obstacle '{name}'; expected one of: {', '.join(sorted(known))}"
            velocity = numbers(velocities.get(name, np.zeros(3)))
            if velocity.shape != (3,) or not np.isfinite(velocity).all():
                found = told(velocities[name])
                return f"update_scene: found {found} as the velocity of '{name}'; expected (3,), m/s"
            self._obstacles[name] = SeenObstacle(name, pin.SE3(pose.matrix), velocity, float(spread), time)
        return ""

    def blocked(self, stretch: PathStretch, law: "TimeLaw", now: float) -> BlockedPlace | None:
        """Return what is blocked of the way that a law leads from `now` on; None if nothing is."""
        return self._watch.blocked(stretch, law, now, list(self._obstacles.values()))

    def over(self, path: ProvedPath, since: float) -> "SeenScene":
        """Return the same about a path that was planned when the scene was as it was until `since`, s."""
        other = SeenScene(path, self._clearance)
        known = {obstacle.name for obstacle in path.run.problem.scene.obstacles}
        other._obstacles = {k: one for k, one in self._obstacles.items() if one.time >= since and k in known}
        return other
