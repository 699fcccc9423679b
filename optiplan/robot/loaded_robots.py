"""Kept in memory: robots whose files have not changed, those that stand as before, and what is made of one once."""

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
"""s since the last change of a file, before which its times do not tell one version from the next."""

Key = tuple[str, str, str, str | None, tuple[Path, ...] | None]
"""What a robot was asked for by: its name, file or content, the folder that paths in a content start from, locked
joints, group, and the folders that may be read."""


Made = TypeVar("Made")


class LoadedRobots:
    """The robots loaded last, each with the files that it was read from."""

    def __init__(self) -> None:
        self._robots: OrderedDict[Key, tuple[Robot, tuple[Signature, ...]]] = OrderedDict()
        self._lock = threading.Lock()

    def get(self, key: Key) -> "Robot | None":
        """The robot loaded by `key`, unless one of its files has changed or may not be read any more."""
        with self._lock:
            robot, seen = self._robots.get(key, (None, ()))
        if robot is None or _signatures(robot.files) != seen:
            return None
        with self._lock:
            if key in self._robots:
                self._robots.move_to_end(key)
        return robot

    def keep(self, key: Key, robot: "Robot", began: float) -> None:
        """Remember a robot whose loading began at this time (`time.time`), unless a file was changed just before."""
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
        """What tells one robot from another; a file is the same from wherever it is referred to.

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
        """The time, s, that files are stamped with."""
        return time.time()


def once_for_each_robot(make: Callable[["Robot"], Made]) -> Callable[["Robot"], Made]:
    """Decorate what is made of a robot alone, wherever it stands and whatever it carries: it is made once.

    `make` is given the robot without base and load; what it returns is kept as long as that robot is.
    """
    kept: WeakKeyDictionary[Robot, Made] = WeakKeyDictionary()

    @wraps(make)
    def made_of(robot: "Robot") -> Made:
        bare = robot.unmounted
        if bare not in kept:
            kept[bare] = make(bare)
        return kept[bare]

    return made_of


def _signatures(paths: tuple[Path, ...]) -> tuple[Signature, ...] | None:
    try:
        return signatures(paths)
    except OSError:
        return None
