"""Commands that choose something about a robot: where it stands, how it is made."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from optiplan.cli.output import saved, say, show_result
from optiplan.cli.progress import ProgressLine
from optiplan.errors import InputError


def shown(
    data: Mapping[str, Any],
    show: Callable[[], None],
    code: int,
    as_json: bool,
    out: Path | None,
    save: Callable[[Path], Sequence[Path]],
) -> int:
    """Save a result in `out`, where that is given, and print it with the files written; return the exit code."""
    unsaved: list[InputError] = []
    files: list[str] = []
    if out is not None:
        with ProgressLine() as progress:
            progress("writing", 0.0)
            files = saved(lambda: save(out), unsaved)

    def told() -> None:
        show()
        for path in files:
            say(f"written: {path}")

    return show_result({**data, "files": files}, told, code, as_json, unsaved)
