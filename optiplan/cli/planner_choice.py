"""The planner that a problem file asks for: whether there is one, with the line where the file asks."""

from pathlib import Path
from typing import Any

from optiplan.errors import InputError, Issue, UnknownChoiceError


def planner_issues(path: Path) -> list[Issue]:
    """What is wrong with the planner and the options that the file names; what its schema refuses is not told again."""
    from optiplan.planners.registry import make_planner
    from optiplan.yaml_lines import read_yaml
    from optiplan.yaml_words import choices

    try:
        document = read_yaml(path)
    except InputError:
        return []
    name, options = _choice(document.data)
    try:
        if name is not None:
            make_planner(name, options)
    except UnknownChoiceError as error:
        place = ("planner", error.found) if error.kind != "planner" else ("planner",)
        known = [choice.partition(" (")[0] for choice in error.choices]
        return [document.issue(place, f"unknown {error.kind} '{error.found}'", choices(error.found, known))]
    except InputError as error:
        return [document.issue(("planner", issue.field), issue.found, issue.expected) for issue in error.issues]
    return []


def _choice(data: Any) -> tuple[str | None, dict[str, Any]]:
    """Name and options as the file gives them; None for a name that is not there or no text."""
    asked = data.get("planner") if isinstance(data, dict) else None
    if isinstance(asked, dict):
        name = asked.get("name", "trajopt")
        return name if isinstance(name, str) else None, {key: asked[key] for key in asked if key != "name"}
    return asked if isinstance(asked, str) and asked else None, {}
