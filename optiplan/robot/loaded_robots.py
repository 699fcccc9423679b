"""Robots kept in memory while their files do not change, and results made once for each robot."""

import json
import threading
import time
from collections import OrderedDict
from collections.abc import Callable, Mapping
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar
from weakref import WeakKeyDictionary

from optiplan.files import Signature, allowed_folders, signatures
from optiplan.robot.reference import robot_file, robot_names

if TYPE_CHECKING:
    from optiplan.robot.robot import Robot

_MOST = 16
_SETTLED = 2.0
"""s; within this time after a change of a file, its time stamps do not distinguish two versions."""

Key = tuple[str, str, str, str | None, tuple[Path, ...] | None]
"""Arguments of `load_robot`: name, file or content; base folder of a content; locked joints; group. The last entry has
the folders that may be read."""


Made = TypeVar("Made")
Thing = TypeVar("Thing")


class LoadedRobots:
    """The robots loaded last, each with the signatures of its files."""

    def __init__(self) -> None:
        self._robots: OrderedDict[Key, tuple[Robot, tuple[Signature, ...]]] = OrderedDict()
        self._lock = threading.Lock()

    def get(self, key: Key) -> "Robot | None":
        """Return the robot loaded by `key`; None if a file has changed or may no longer be read."""
        with self._lock:
            robot, seen = self._robots.get(key, (None, ()))
        if robot is None or _signatures(robot.files) != seen:
            return None
        with self._lock:
            if key in self._robots:
                self._robots.move_to_end(key)
        return robot

    def keep(self, key: Key, robot: "Robot", began: float) -> None:
        """Keep a robot whose loading began at this time (`time.time`), unless a file changed just before."""
        seen = _signatures(robot.files)
        if seen is None or any(began - file.changed < _SETTLED for file in seen):
            return
        with self._lock:
            self._robots[key] = robot, seen
            while len(self._robots) > _MOST:
                self._robots.popitem(last=False)

    @staticmethod
    def key(
        ref: str | Mapping[str, Any], base: Path | None, locked: Mapping[str, float] | None, group: str | None
    ) -> Key:
        """Return the key of a robot; a file has the same key from every folder.

        Raises:
            UnknownChoiceError: as `robot_file`.
        """
        if isinstance(ref, str):
            named, folder = ref if ref in robot_names() else str(robot_file(ref, base).resolve()), ""
        else:
            named, folder = json.dumps(ref, sort_keys=True, default=repr), str((base or Path()).absolute())
        return named, folder, json.dumps(dict(locked or {}), sort_keys=True), group, allowed_folders()

    @staticmethod
    def now() -> float:
        """Return the clock of file time stamps, s."""
        return time.time()


def once_for_each_robot(make: Callable[["Robot"], Made]) -> Callable[["Robot"], Made]:
    """Decorate a function of a robot, independent of base and load, so that its result is made once for each robot.

    `make` gets the robot without base and load; its result is kept as long as that robot.
    """
    made_of = once_for_each(make)
    return wraps(make)(lambda robot: made_of(robot.unmounted))


def once_for_each(make: Callable[[Thing], Made]) -> Callable[[Thing], Made]:
    """Decorate a function of one object so that its result is made once for each, and kept as long as the object."""
    kept: WeakKeyDictionary[Thing, Made] = WeakKeyDictionary()

    @wraps(make)
    def made_of(thing: Thing) -> Made:
        if thing not in kept:
            kept[thing] = make(thing)
        return kept[thing]

    return made_of


def _signatures(paths: tuple[Path, ...]) -> tuple[Signature, ...] | None:
    try:
        return signatures(paths)
    except OSError:
        return None
