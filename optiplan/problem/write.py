"""Write problems: as YAML text, in a line, as a small table."""

import html
import json
import re
from collections.abc import Mapping
from typing import Any

from optiplan.errors import counted
from optiplan.problem.goals_and_vias import AllOfGoal, Goal, JointGoal, PoseGoal

PLAIN_TEXT = re.compile(r"[A-Za-z_][A-Za-z0-9_./-]*")
NOT_TEXT = {"true", "false", "null", "yes", "no", "on", "off", "y", "n"}
"""Words that some YAML version reads as something other than text."""


def problem_text(data: Mapping[str, Any], comment: str = "") -> str:
    """A problem as YAML 1.2, one line a key, a via and a body, floats in full: reading it gives `data` again.

    Args:
        data: plain data with text keys.
        comment: lines for the head of the file.
    """
    lines = [f"# {line}" for line in comment.splitlines()]
    for key, value in data.items():
        if key == "scene":
            lines.append("scene:")
            for group, bodies in value.items():
                lines.append(f"  {group}:" + ("" if bodies else " []"))
                lines += [f"    - {flow(body)}" for body in bodies]
        elif key == "via" and value:
            lines += ["via:", *(f"  - {flow(via)}" for via in value)]
        else:
            lines.append(f"{key}: {flow(value)}")
    return "\n".join(lines) + "\n"


def flow(value: Any) -> str:
    """Return plain data as YAML 1.2 in one line."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{flow(key)}: {flow(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(flow, value)) + "]"
    if isinstance(value, str) and PLAIN_TEXT.fullmatch(value) and value.lower() not in NOT_TEXT:
        return value
    return _quoted(value) if isinstance(value, str) else json.dumps(value, allow_nan=False)


def _quoted(text: str) -> str:
    text = text.replace("\\", "\\\\").replace('"', '\\"')
    return '"' + "".join(c if c.isprintable() else f"\\U{ord(c):08X}" for c in text) + '"'


def end_words(goal: Goal, steps: int) -> str:
    """Return where a problem leads, in a few words: to one of its ends, or through so many steps."""
    if steps:
        return f"do {counted(steps, 'step')}"
    if len(goal) != 1:
        return f"any of {len(goal)} ends"
    end = goal[0]
    if isinstance(end, JointGoal):
        return "a configuration"
    if isinstance(end, AllOfGoal):
        return f"places of {' and '.join(part.frame for part in end.parts)}"
    return f"a {'pose' if isinstance(end, PoseGoal) else 'region'} of {end.frame}"


def problem_table(name: str, rows: Mapping[str, Any]) -> str:
    """Return a small table in HTML, without the rows that have no value."""
    cells = "".join(f"<tr><th>{key}</th><td>{html.escape(str(v))}</td></tr>" for key, v in rows.items() if v)
    return f"<table><caption>Problem: {html.escape(name)}</caption>{cells}</table>"
