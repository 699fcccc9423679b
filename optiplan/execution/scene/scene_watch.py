"""What obstacles block of the rest of a path, after they have moved."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from optiplan._core import core
from optiplan.arrays import Array
from optiplan.collision.native_model import NativeCollisionModel, standing_body
from optiplan.execution.paths.path_laws import resting_place
from optiplan.execution.paths.proved_path import PathStretch, ProvedPath
from optiplan.geometry.scene import Attachment, Obstacle, Scene
from optiplan.geometry.shape import Shape
from optiplan.records import dataclass
from optiplan.trajectory.joining import cut_trajectory
from optiplan.trajectory.trajectory import Trajectory

if TYPE_CHECKING:
    from optiplan._core._core_base import PathWatch, TimeLaw

CELL = 4e-3
"""s: parts of a path in which the robot's bodies are bounded about one place."""

SAME_PLACE = 1e-9
"""m, and of directions: so far apart two poses are one."""


@dataclass(frozen=True, eq=False)
class SeenObstacle:
    """An obstacle as it was seen at a time of the executor.

    Attributes:
        name: of the obstacle.
        shape: in its own frame.
        X_WO: pose of its frame in the world.
        velocity: (3,), of that frame, m/s.
        spread: m/s; it may be anywhere within this speed times the time since, around where its velocity leads.
        time: of the executor, s.
        expected: whether it stands where the run had it at that time. What a task does to it later is in the path.
    """

    name: str
    shape: Shape
    X_WO: pin.SE3
    velocity: Array
    spread: float
    time: float
    expected: bool = False


class BlockedPlace(NamedTuple):
    """The first place of a path that an obstacle blocks, s, and the names of the two bodies that would meet."""

    place: float
    pair: tuple[str, str]

    def __str__(self) -> str:
        """What would happen, in words."""
        return f"'{self.pair[0]}' would meet '{self.pair[1]}' at {self.place:.3f} s of the path"


class NearestPlace(NamedTuple):
    """The place of a path that leaves the least of a distance, s, the two bodies, and how much it leaves, m."""

    place: float
    pair: tuple[str, str]
    slack: float


class SceneWatch:
    """The rest of a proved path among obstacles that move.

    In cells of 4 ms of the path, a pair is clear if its distance in the middle exceeds what the robot and the obstacle
    travel until the cell is left. Distances are those of the native core. Only obstacles that were seen are queried,
    those of the run's scene and others.

    Holds at: all times of a law until the robot stands still, and `linger` s after that for obstacles that keep their
    velocity.

    Where the problem asks for a clearance, obstacles that are not where the run was proved with them have to be as far
    off; with groups of pairs, as far as the most of these.

    Args:
        path: its run gives robot and scene.
        margin: distance to keep from the obstacles that were seen, m.
        linger: s, for which obstacles are followed where the robot stands still.
    """

    def __init__(self, path: ProvedPath, margin: float, linger: float = 0.0) -> None:
        self.path, self.margin, self._linger = path, margin, linger
        safety = path.run.problem.scene.safety
        self.asked = 0.0 if safety is None else max(safety.scene, *(one.at_least for one in safety.pairs), 0.0)
        self._watches: WeakKeyDictionary[PathStretch, list[_PartWatch]] = WeakKeyDictionary()

    @property
    def scene(self) -> Scene:
        """The scene of the run."""
        return self.path.run.problem.scene

    def blocked(
        self, stretch: PathStretch, law: "TimeLaw", now: float, seen: Sequence[SeenObstacle], spare: float = 0.0
    ) -> BlockedPlace | None:
        """Return what is blocked of the way that a law leads from `now` on, first in time; None if nothing is.

        `spare`, m, is added to the margin.
        """
        if not seen:
            return None
        parts = self._parts(stretch)
        rest = resting_place(law, now)
        for part in parts:
            last = part.begin <= rest and (rest <= part.end or part is parts[-1])
            found = part.blocked(law, now, seen, max(self.margin, self.asked) + spare, self._linger if last else 0.0)
            if found is not None:
                return BlockedPlace(stretch.place(found.place), found.pair)
        return None

    def expects(self, seen: SeenObstacle, place: float) -> bool:
        """Whether an obstacle stands where the run has it when the robot is at a place of the path, s."""
        if seen.spread > 0.0 or seen.velocity.any():
            return False
        return any(one.name == seen.name and is_at(one, seen) for one in self._known(place))

    def standing(self, place: float, now: float) -> list[SeenObstacle]:
        """Return the obstacles of the run as they stand when the robot is at a place of the path, s."""
        return [SeenObstacle(one.name, one.shape, one.X_WO, np.zeros(3), 0.0, now) for one in self._known(place)]

    def _known(self, place: float) -> tuple[Obstacle, ...]:
        return self.path.parts[self.path.part_at(place)].problem.scene.obstacles

    def nearest(
        self,
        stretch: PathStretch,
        law: "TimeLaw",
        now: float,
        seen: Sequence[SeenObstacle],
        margin: float,
        most: float,
    ) -> NearestPlace | None:
        """Return what comes nearest on the way that a law leads from `now` until the robot stands still.

        The slack is the distance less `margin`, m, and what an obstacle may have moved since it was seen, at that time.
        The first body of the pair is the obstacle. None where the slack exceeds `most`, m, everywhere.
        """
        least, here = None, law.at(now)[0]
        rest = resting_place(law, now)
        for part in self._parts(stretch) if seen else ():
            if part.begin > rest or part.end < here:
                continue
            found = part.nearest(law, now, seen, margin, most if least is None else least.slack)
            if found is not None:
                least = NearestPlace(stretch.place(found.place), found.pair, found.slack)
        return least

    def over(self, path: ProvedPath) -> "SceneWatch":
        """Return the same of another path."""
        return SceneWatch(path, self.margin, self._linger)

    def prepare(self, stretch: PathStretch) -> None:
        """Make what a stretch needs, which takes milliseconds, before the first question about it."""
        self._parts(stretch)

    def _parts(self, stretch: PathStretch) -> "list[_PartWatch]":
        """Return a watch of each part of a stretch with a scene of its own, in the order in which they are passed."""
        if stretch not in self._watches:
            motion, found = stretch.laws.motion, list[_PartWatch]()
            if stretch.model is not None:
                found.append(_PartWatch(_without_floors(stretch.model), motion, 0.0, []))
            for part in self.path.parts:
                begin, end = sorted(stretch.direction * (place - stretch.start) for place in (part.begin, part.end))
                begin, end = max(begin, 0.0), min(end, motion.duration)
                if end > begin:
                    whole = (begin, end) == (0.0, motion.duration)
                    cut = motion if whole else cut_trajectory(motion, begin, end)
                    model = NativeCollisionModel(part.problem.robot, replace(part.problem.scene, safety=None))
                    found.append(_PartWatch(model, cut, begin, part.problem.tracking_error.tolist()))
            self._watches[stretch] = sorted(found, key=lambda part: part.begin)
        return self._watches[stretch]


class _PartWatch:
    """A part of a path in which what is held stays the same."""

    def __init__(self, model: NativeCollisionModel, motion: Trajectory, begin: float, error: list[float]) -> None:
        self.begin, self.end, self._model = begin, begin + motion.duration, model
        bodies: list[Obstacle | Attachment] = [*model.scene.obstacles, *model.scene.attached]
        places = {name: k for k, name in enumerate(model.names)}
        self._known = {body.name: (body.shape, places[body.name]) for body in bodies}
        self._added = _added.setdefault(model, [])
        self._core: PathWatch | None = None
        if model.world is not None:
            self._core = core.PathWatch.of(model.world, motion.breakpoints, motion.coefficients, CELL, begin, error)

    def blocked(
        self, law: "TimeLaw", now: float, seen: Sequence[SeenObstacle], margin: float, linger: float
    ) -> BlockedPlace | None:
        """See `SceneWatch.blocked`; a scene that the core does not know is blocked everywhere."""
        bodies, unknown = self._bodies(seen)
        if self._core is None or unknown:
            return BlockedPlace(max(law.at(now)[0], self.begin), (unknown, "the robot"))
        found = self._core.blocked(law, now, bodies, *_arrays(seen), margin, linger)
        if found is None:
            return None
        place, a, b = found
        return BlockedPlace(place, (self._name(a), self._name(b)))

    def nearest(
        self, law: "TimeLaw", now: float, seen: Sequence[SeenObstacle], margin: float, most: float
    ) -> NearestPlace | None:
        """See `SceneWatch.nearest`; what the core does not know is as near as can be."""
        bodies, unknown = self._bodies(seen)
        if self._core is None or unknown:
            return NearestPlace(max(law.at(now)[0], self.begin), (unknown, "the robot"), -np.inf)
        found = self._core.nearest(law, now, bodies, *_arrays(seen), margin, most)
        if found is None:
            return None
        place, a, b, slack = found
        pair = (a, b) if a in bodies else (b, a)
        return NearestPlace(place, (self._name(pair[0]), self._name(pair[1])), slack)

    def _bodies(self, seen: Sequence[SeenObstacle]) -> tuple[NDArray[np.int64], str]:
        """Return the bodies of obstacles (k,), and the name of one that the core does not know, if any."""
        found = [] if self._core is None else [self._body(one, seen) for one in seen]
        unknown = self._model.unknown[0] if self._core is None else ""
        if None in found:
            unknown = seen[found.index(None)].name
        return np.array([] if unknown else found, dtype=np.int64), unknown

    def _body(self, one: SeenObstacle, seen: Sequence[SeenObstacle]) -> int | None:
        """Return the body of an obstacle, added where there is none of its shape yet; None: the core does not know it.

        Bodies of obstacles that are not seen any more are taken again.
        """
        shape, known = self._known.get(one.name, (None, 0))
        if shape is not None and same_body(shape, one.shape):
            return known
        for k, (name, shape, body) in enumerate(self._added):
            if same_body(shape, one.shape) and (name == one.name or all(other.name != name for other in seen)):
                self._added[k] = one.name, shape, body
                return body
        made = standing_body(one.shape)
        assert self._core is not None
        self._added.append((one.name, one.shape, None if made is None else self._core.add(made)))
        return self._added[-1][2]

    def _name(self, body: int) -> str:
        if body < len(self._model.names):
            return self._model.names[body]
        return next(name for name, _, added in self._added if added == body)


_added: WeakKeyDictionary[NativeCollisionModel, list[tuple[str, Shape, int | None]]] = WeakKeyDictionary()
"""Obstacles added to the world of a model, by whichever watch, with their bodies; None: the core does not know it."""


def _without_floors(model: NativeCollisionModel) -> NativeCollisionModel:
    """Return a model of the same bodies whose distances are those of the bodies; itself where it is one."""
    if model.scene.safety is None:
        return model
    return NativeCollisionModel(model.robot, replace(model.scene, safety=None), model)


def _arrays(seen: Sequence[SeenObstacle]) -> tuple[Array, Array]:
    """Return poses (k, 4, 4), and velocity, spread and time (k, 5)."""
    motions = np.array([[*one.velocity, one.spread, one.time] for one in seen])
    return np.array([one.X_WO.homogeneous for one in seen]), motions


def same_body(one: Shape, other: Shape) -> bool:
    """Whether two shapes are one."""
    return one is other or (type(one) is type(other) and one.same_body(other))


def is_at(obstacle: Obstacle, seen: SeenObstacle) -> bool:
    """Whether an obstacle of a run stands where it was seen, but for rounding."""
    found = obstacle.X_WO.homogeneous, seen.X_WO.homogeneous
    return same_body(obstacle.shape, seen.shape) and np.allclose(*found, rtol=0.0, atol=SAME_PLACE)
