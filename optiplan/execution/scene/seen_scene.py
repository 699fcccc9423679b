"""The scene as it was seen while a robot moves, and what of it blocks the rest of the path."""

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array, is_finite
from optiplan.errors import described
from optiplan.execution.arguments import numbers
from optiplan.execution.paths.next_path import NextPath
from optiplan.execution.paths.proved_path import PathStretch, ProvedPath
from optiplan.execution.scene.scene_watch import BlockedPlace, SceneWatch, SeenObstacle, is_at
from optiplan.execution.scene.separation import SeparationMonitor
from optiplan.geometry.pose import Pose, Values
from optiplan.geometry.scene import Obstacle, Scene

if TYPE_CHECKING:
    from optiplan._core._core_base import TimeLaw

SceneUpdate = Mapping[str, Pose | Obstacle | None]
"""What is where, by name: the pose of a known obstacle, one that appears, or None for one that is gone."""


class SeenScene:
    """What `Executor.update_scene` was given, about one path.

    Args:
        watch: of the path; its run gives the robot and the obstacles that are known.
        people: what keeps people apart, if they are.
    """

    def __init__(self, watch: SceneWatch, people: SeparationMonitor | None = None) -> None:
        self.watch, self.people = watch, people
        self._obstacles: dict[str, SeenObstacle] = {}
        self._gone: set[str] = set()
        self._times: dict[str, float] = {}  # of what was seen last, or found gone, s

    def see(
        self, poses: SceneUpdate, velocities: Mapping[str, Values], spread: float, now: float, place: float, age: float
    ) -> str:
        """Remember where obstacles were `age` s ago; return why that is not possible, or nothing.

        The robot is at a `place` of the path, s, `now`.
        """
        if not isinstance(poses, Mapping):
            return f"update_scene: found {described(poses)}; expected poses by name"
        for value, word, unit in ((spread, "a spread", "a speed >= 0, m/s"), (age, "an age", "seconds >= 0")):
            if not is_finite(value) or value < 0.0:
                return f"update_scene: found {word} of {described(value)}; expected {unit}"
        if not isinstance(velocities, Mapping):
            return f"update_scene: found {described(velocities)}; expected velocities by name"
        lost = next((name for name in velocities if name not in poses), None)
        for name, pose in poses.items():
            velocity = np.array(numbers(velocities.get(name, np.zeros(3))))  # the caller may write into its own again
            if velocity.shape != (3,) or not np.isfinite(velocity).all():
                found = described(velocities[name])
                return f"update_scene: found {found} as the velocity of '{name}'; expected (3,), m/s"
            if name in velocities and self._is_person(name):
                return f"update_scene: found a velocity of '{name}'; expected none: the course of people is not known"
            reason = self._see(name, pose, velocity, float(spread), now - float(age), place)
            if reason:
                return reason
        without = "without a pose; expected both"
        return "" if lost is None else f"update_scene: found a velocity of {described(lost)} {without}"

    def _see(
        self, name: str, pose: Pose | Obstacle | None, velocity: Array, spread: float, time: float, place: float
    ) -> str:
        known = {one.name: one.shape for one in self.watch.scene.obstacles}
        known |= {one.name: one.shape for one in self._obstacles.values()}
        known |= {} if self.people is None else self.people.shapes
        if not isinstance(pose, Pose | Obstacle | None):
            return f"update_scene: found {described(pose)} as '{name}'; expected poses by name, obstacles, or None"
        if isinstance(pose, Obstacle) and isinstance(name, str) and pose.motion is None:
            shape, X_WO = pose.shape, pose.X_WO
        elif isinstance(pose, Obstacle):
            return f"update_scene: found {described(pose)} as {described(name)}; expected one that stands, and a name"
        elif pose is None and self.people is not None and self._is_person(name):
            self.people.see(name, None, time)
            return ""
        elif name not in known:
            expected = f"one of: {', '.join(sorted(known))}" if known else "an obstacle, as none is known yet"
            return f"update_scene: found an obstacle {described(name)}; expected {expected}"
        else:
            shape, X_WO = known[name], None if pose is None else pin.SE3(pose.matrix)
        if self.people is not None and self._is_person(name):
            speed = self.people.rule.human_speed
            self.people.see(name, SeenObstacle(name, shape, X_WO, velocity, speed, time), time)
            return ""
        if time < self._times.get(name, -np.inf):  # data may come out of order
            return ""
        self._times[name] = time
        if X_WO is None:
            self._obstacles.pop(name, None)
            self._gone.add(name)
        else:
            self._gone.discard(name)
            one = SeenObstacle(name, shape, X_WO, velocity, spread, time)
            self._obstacles[name] = replace(one, expected=self.watch.expects(one, place))
        return ""

    def age(self, duration: float) -> bool:
        """Let a time, s, pass without ticks; return whether that changes where anything may be by now."""
        self._times = {name: time - duration for name, time in self._times.items()}
        changes = self.people is not None
        for name, one in self._obstacles.items():
            self._obstacles[name] = replace(one, time=one.time - duration)
            changes = changes or one.spread > 0.0 or bool(one.velocity.any())
        if self.people is not None:
            self.people.age(duration)
        return changes

    def _is_person(self, name: str) -> bool:
        return self.people is not None and name in self.people.rule.people

    def blocked(
        self, stretch: PathStretch, law: "TimeLaw", now: float, spare: float = 0.0, *, known: bool = False
    ) -> BlockedPlace | None:
        """Return what is blocked of the way that a law leads from `now` on, with a margin to spare; None: nothing.

        By obstacles that were seen; by those that are `known` from the run, too, where the way is not its path.
        """
        seen = list(self._obstacles.values())
        if self.watch.margin <= self.watch.asked:  # cells are too coarse to tell what is just kept, as proved
            seen = [one for one in seen if not one.expected]
        elif known:
            skipped = {*self._obstacles, *self._gone}
            seen += [one for one in self.watch.standing(stretch.start, now) if one.name not in skipped]
        return self.watch.blocked(stretch, law, now, seen, spare)

    def watch_over(self, path: ProvedPath, *, at_once: bool = False) -> SceneWatch:
        """Return the watch of another path, prepared if anything was seen, or `at_once`."""
        watch = self.watch.over(path)
        if at_once or self._obstacles:
            watch.prepare(path.forwards)
        return watch

    def prepare(self, stretch: PathStretch, *, at_once: bool = False) -> None:
        """Make what a stretch needs, if anything was seen, or `at_once`."""
        if at_once or self._obstacles:
            self.watch.prepare(stretch)

    def at(self, then: float) -> Scene:
        """Return the scene as it will be at a time, s, from which obstacles with a velocity move on."""
        scene = self.watch.scene
        scene = scene.without(*(self._gone & {one.name for one in scene.obstacles}))
        return scene.with_(*(_later(one, then) for one in self._obstacles.values()))

    @property
    def names(self) -> tuple[str, ...]:
        """Of the obstacles that were seen."""
        return tuple(self._obstacles)

    @property
    def spread(self) -> float:
        """The largest spread that was seen, m/s."""
        return max((one.spread for one in self._obstacles.values()), default=0.0)

    def over(self, coming: NextPath) -> "SeenScene":
        """Return the same about the path that takes over.

        Obstacles that it was proved against where they were seen are forgotten, unless they move, or more distance is
        to be kept from them than was proved.
        """
        path = coming.path
        watch = self.watch.over(path) if coming.watch is None else coming.watch
        other = SeenScene(watch, None if self.people is None else self.people.over(path, watch))
        other._times = dict(self._times)
        stands = {one.name: one for one in path.run.problem.scene.obstacles}
        keeps = watch.margin > watch.asked
        for name, one in self._obstacles.items():
            if keeps or name not in stands or one.spread > 0.0 or one.velocity.any() or not is_at(stands[name], one):
                other._obstacles[name] = replace(one, expected=False)
        return other


def _later(one: SeenObstacle, then: float) -> Obstacle:
    if not one.velocity.any():
        return Obstacle(one.name, one.shape, one.X_WO)
    X = pin.SE3(one.X_WO.rotation, one.X_WO.translation + (then - one.time) * one.velocity)
    return Obstacle(one.name, one.shape, X).moving([[0.0, rate] for rate in one.velocity])
