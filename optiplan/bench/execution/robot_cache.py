"""Robots kept between problems: loading one takes longer than planning an easy problem."""

import json
from collections.abc import Container, Mapping
from pathlib import Path
from typing import Any

from optiplan.cache import MostRecent
from optiplan.robot.robot import Robot, load_robot, robot_file


class RobotCache:
    """Cached `load_robot`; files are not read again when they change.

    Args:
        most: robots kept, those used last.
        only: names of the robots kept; None: any.
    """

    def __init__(self, most: int = 64, only: Container[str] | None = None) -> None:
        self._robots: MostRecent[Robot] = MostRecent(most)
        self._only = only

    def __call__(
        self,
        ref: str | Mapping[str, Any],
        base: Path | None = None,
        locked: Mapping[str, float] | None = None,
        group: str | None = None,
    ) -> Robot:
        """Return the robot as `load_robot` gives it, with the same errors."""
        if self._only is not None and (isinstance(ref, Mapping) or ref not in self._only):
            return load_robot(ref, base, locked, group)
        one = [ref, str(base)] if isinstance(ref, Mapping) else str(robot_file(ref, base))
        key = json.dumps([one, dict(locked or {}), group], sort_keys=True)
        return self._robots.get(key, lambda: load_robot(ref, base, locked, group))
