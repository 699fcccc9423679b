"""The scene as it was seen while a robot moves, and what of it blocks the rest of the path."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from optiplan.arrays import is_finite
from optiplan.execution.arguments import numbers, told
from optiplan.execution.proved_path import PathStretch, ProvedPath
from optiplan.execution.scene_watch import BlockedPlace, SceneWatch, SeenObstacle
from optiplan.execution.separation import Separation
from optiplan.geometry.pose import Pose, Values

if TYPE_CHECKING:
    from optiplan._core._core_base import TimeLaw


class SeenScene:
    """What `Executor.update_scene` was told, about one path.

    Args:
        path: its run gives the robot and the obstacles that are known.
        clearance: distance to keep from obstacles that moved, m.
        rule: how people are kept apart, if they are.
    """

    def __init__(self, path: ProvedPath, clearance: float, rule: Separation | None = None) -> None:
        self._watch, self._clearance, self._rule = SceneWatch(path, clearance), clearance, rule
        self._obstacles: dict[str, SeenObstacle] = {}
        self._people: dict[str, SeenObstacle] = {}

    @property
    def people(self) -> list[SeenObstacle]:
        """Where people were measured last."""
        return list(self._people.values())

    def see(
        self, poses: Mapping[str, Pose], velocities: Mapping[str, Values], spread: float, now: float, age: float = 0.0
    ) -> str:
        """Remember where obstacles were `age` s ago; return why that is not possible, or nothing."""
        if not isinstance(poses, Mapping) or not all(isinstance(pose, Pose) for pose in poses.values()):
            return f"update_scene: found {told(poses)}; expected poses by name"
        if not isinstance(velocities, Mapping):
            return f"update_scene: found {told(velocities)}; expected velocities by name"
        for value, word, unit in ((spread, "a spread", "a speed >= 0, m/s"), (age, "an age", "seconds >= 0")):
            if not is_finite(value) or value < 0.0:
                return f"update_scene: found {word} of {told(value)}; expected {unit}"
        for name, pose in poses.items():
            reason = self._see(name, pose, velocities, float(spread), now - float(age))
            if reason:
                return reason
        return ""

    def _see(self, name: str, pose: Pose, velocities: Mapping[str, Values], spread: float, time: float) -> str:
        known = {obstacle.name for obstacle in self._watch.scene.obstacles}
        if name not in known:
            return f"update_scene: found an obstacle '{name}'; expected one of: {', '.join(sorted(known))}"
        velocity, X = numbers(velocities.get(name, np.zeros(3))), pin.SE3(pose.matrix)
        if velocity.shape != (3,) or not np.isfinite(velocity).all():
            return f"update_scene: found {told(velocities[name])} as the velocity of '{name}'; expected (3,), m/s"
        if self._rule is None or name not in self._rule.people:
            self._obstacles[name] = SeenObstacle(name, X, velocity, spread, time)
        elif name in velocities:
            return f"update_scene: found a velocity of '{name}'; expected none: the course of people is not known"
        elif name not in self._people or self._people[name].time <= time:  # data may come out of order
            self._people[name] = SeenObstacle(name, X, velocity, float(self._rule.human_speed), time)
        return ""

    def blocked(self, stretch: PathStretch, law: "TimeLaw", now: float) -> BlockedPlace | None:
        """Return what is blocked of the way that a law leads from `now` on; None if nothing is."""
        return self._watch.blocked(stretch, law, now, list(self._obstacles.values()))

    def over(self, path: ProvedPath, since: float) -> "SeenScene":
        """Return the same about a path that was planned when the scene was as it was until `since`, s."""
        other = SeenScene(path, self._clearance, self._rule)
        known = {obstacle.name for obstacle in path.run.problem.scene.obstacles}
        other._obstacles = {k: one for k, one in self._obstacles.items() if one.time >= since and k in known}
        other._people = self._people
        return other
