"""Robots kept between problems: loading one takes longer than planning an easy problem."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from optiplan.robot.robot import Robot, load_robot, robot_file


class RobotCache:
    """Cached `load_robot`; files are not read again when they change."""

    def __init__(self) -> None:
        self._robots: dict[tuple[object, ...], Robot] = {}

    def __call__(
        self,
        ref: str | Mapping[str, Any],
        base: Path | None = None,
        locked: Mapping[str, float] | None = None,
        group: str | None = None,
    ) -> Robot:
        """The robot as `load_robot` gives it, which tells what can go wrong."""
        one = json.dumps([ref, str(base)], sort_keys=True) if isinstance(ref, Mapping) else robot_file(ref, base)
        key = (one, tuple(sorted((locked or {}).items())), group)
        if key not in self._robots:
            self._robots[key] = load_robot(ref, base, locked, group)
        return self._robots[key]
