"""Problem files as text, written in one stroke."""

import errno
import json
import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

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
                lines += [f"    - {_flow(body)}" for body in bodies]
        elif key == "via" and value:
            lines += ["via:", *(f"  - {_flow(via)}" for via in value)]
        else:
            lines.append(f"{key}: {_flow(value)}")
    return "\n".join(lines) + "\n"


def write_text(path: Path, text: str) -> None:
    """Write a file so that it is never seen half-written; missing folders are made."""
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.is_dir():
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        temporary.write_text(text, encoding="utf-8")
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def _flow(value: Any) -> str:
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_flow(key)}: {_flow(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_flow, value)) + "]"
    if isinstance(value, str) and PLAIN_TEXT.fullmatch(value) and value.lower() not in NOT_TEXT:
        return value
    return _quoted(value) if isinstance(value, str) else json.dumps(value, allow_nan=False)


def _quoted(text: str) -> str:
    text = text.replace("\\", "\\\\").replace('"', '\\"')
    return '"' + "".join(c if c.isprintable() else f"\\U{ord(c):08X}" for c in text) + '"'
