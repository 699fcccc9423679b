"""Shell completion of arguments: names of examples, robots and planners.

A function returns the names that begin with the text typed, and none where files do: the shell completes those.
"""

from collections.abc import Iterable
from pathlib import Path

from optiplan.resources import control_dir, problems_dir, robots_dir


def problem_names(incomplete: str) -> list[str]:
    """Examples."""
    return _beginning(incomplete, (path.stem for path in problems_dir().glob("*.yaml")))


def control_names(incomplete: str) -> list[str]:
    """Example control files."""
    return _beginning(incomplete, (path.stem for path in control_dir().glob("*.yaml")))


def robot_names(incomplete: str) -> list[str]:
    """Shipped robots."""
    return _beginning(incomplete, (path.parent.name for path in robots_dir().glob("*/robot.yaml")))


def planner_names(incomplete: str) -> list[str]:
    """Planners, and `all`; after a comma those not named yet."""
    from optiplan.planners.registry import PLANNERS

    named, comma, last = incomplete.rpartition(",")
    choices = set(PLANNERS) - set(named.split(",")) if comma else {"all", *PLANNERS}
    return sorted(f"{named}{comma}{name}" for name in choices if name.startswith(last))


def _beginning(incomplete: str, names: Iterable[str]) -> list[str]:
    typed = Path(incomplete)
    folder, start = (typed, "") if incomplete.endswith("/") else (typed.parent, typed.name)
    if folder.is_dir() and any(
        path.name.startswith(start) and not path.name.startswith(".") for path in folder.iterdir()
    ):
        return []
    return sorted(name for name in names if name.startswith(incomplete))
