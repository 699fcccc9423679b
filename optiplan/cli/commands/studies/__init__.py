"""Commands that choose something about a robot: where it stands, how it is made."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from optiplan.cli.output import print_json, say


def shown(data: Mapping[str, Any], show: Callable[[], None], files: Sequence[str], code: int, as_json: bool) -> int:
    """Print a result as JSON, or by `show` and with the files that were written; return the exit code."""
    if as_json:
        print_json({**data, "files": list(files), "exit_code": code})
        return code
    show()
    for path in files:
        say(f"written: {path}")
    return code
