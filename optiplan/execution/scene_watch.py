"""What obstacles block of the rest of a path, after they have moved."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pinocchio as pin

from optiplan._core import core
from optiplan.arrays import Array
from optiplan.collision.native_model import NativeCollisionModel
from optiplan.execution.proved_path import PathStretch, ProvedPath
from optiplan.geometry.scene import Scene
from optiplan.trajectory.joining import cut_trajectory
from optiplan.trajectory.trajectory import Trajectory

if TYPE_CHECKING:
    from optiplan._core._core_base import PathWatch, TimeLaw

CELL = 4e-3
"""s: parts of a path in which the robot's bodies are bounded about one place."""


@dataclass(frozen=True, eq=False)
class SeenObstacle:
    """An obstacle as it was seen at a time of the executor.

    Attributes:
        name: in the scene.
        X_WO: pose of its frame in the world.
        velocity: (3,), of that frame, m/s.
        spread: m/s; it may be anywhere within this speed times the time since, around where its velocity leads.
        time: of the executor, s.
    """

    name: str
    X_WO: pin.SE3
    velocity: Array
    spread: float
    time: float


class BlockedPlace(NamedTuple):
    """The first place of a path that an obstacle blocks, s, and the names of the two bodies that would meet."""

    place: float
    pair: tuple[str, str]


class SceneWatch:
    """The rest of a proved path among obstacles that move.

    In cells of 4 ms of the path, a pair is clear if its distance in the middle exceeds what the robot and the obstacle
    travel until the cell is left. Distances are those of the native core. Only obstacles that were seen are queried.

    Holds at: all times of a law until the robot stands still.

    Args:
        path: its run gives robot and scene.
        margin: distance to keep from the obstacles that moved, m.
    """

    def __init__(self, path: ProvedPath, margin: float) -> None:
        self._path, self._margin = path, margin
        self._watches: dict[int, list[_PartWatch]] = {}

    @property
    def scene(self) -> Scene:
        """The scene of the run."""
        return self._path.run.problem.scene

    def blocked(
        self, stretch: PathStretch, law: "TimeLaw", now: float, seen: Sequence[SeenObstacle]
    ) -> BlockedPlace | None:
        """Return what is blocked of the way that a law leads from `now` on, first in time; None if nothing is."""
        if not seen:
            return None
        for part in self._parts(stretch):
            found = part.blocked(law, now, seen, self._margin)
            if found is not None:
                return BlockedPlace(stretch.place(found.place), found.pair)
        return None

    def _parts(self, stretch: PathStretch) -> "list[_PartWatch]":
        """Return a watch of each part of a stretch with a scene of its own, in the order in which they are passed."""
        key = id(stretch)
        if key not in self._watches:
            motion, found = stretch.laws.motion, list[_PartWatch]()
            for part in self._path.parts:
                begin, end = sorted(stretch.direction * (place - stretch.start) for place in (part.begin, part.end))
                begin, end = max(begin, 0.0), min(end, motion.duration)
                if end > begin:
                    whole = (begin, end) == (0.0, motion.duration)
                    cut = motion if whole else cut_trajectory(motion, begin, end)
                    model = NativeCollisionModel(part.problem.robot, part.problem.scene)
                    found.append(_PartWatch(model, cut, begin, part.problem.tracking_error.tolist()))
            self._watches[key] = sorted(found, key=lambda part: part.begin)
        return self._watches[key]


class _PartWatch:
    """A part of a path in which what is held stays the same."""

    def __init__(self, model: NativeCollisionModel, motion: Trajectory, begin: float, error: list[float]) -> None:
        self.begin, self._model = begin, model
        self._names = {name: k for k, name in enumerate(model.names)}
        self._core: PathWatch | None = None
        if model.world is not None:
            self._core = core.PathWatch.of(model.world, motion.breakpoints, motion.coefficients, CELL, begin, error)

    def blocked(self, law: "TimeLaw", now: float, seen: Sequence[SeenObstacle], margin: float) -> BlockedPlace | None:
        """See `SceneWatch.blocked`; a scene that the core does not know is blocked everywhere."""
        if self._core is None:
            return BlockedPlace(max(law.at(now)[0], self.begin), (self._model.unknown[0], "the robot"))
        here = [one for one in seen if one.name in self._names]
        if not here:
            return None
        found = self._core.blocked(
            law,
            now,
            np.array([self._names[one.name] for one in here], dtype=np.int64),
            np.array([one.X_WO.homogeneous for one in here]),
            np.array([[*one.velocity, one.spread, one.time] for one in here]),
            margin,
        )
        if found is None:
            return None
        place, index = found
        pair = self._model.pairs[index]
        return BlockedPlace(place, (self._model.names[pair.a], self._model.names[pair.b]))
