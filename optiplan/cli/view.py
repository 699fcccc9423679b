"""`optiplan view`: runs in the browser, or as a page to send."""

from pathlib import Path
from typing import Annotated

import typer


def view(
    runs: Annotated[list[Path], typer.Argument(metavar="RUN…", help="run folders; the first one's scene is shown")],
    export: Annotated[Path | None, typer.Option(metavar="PAGE.html", help="write one file, serve nothing")] = None,
    port: Annotated[int, typer.Option(min=0, max=65535, metavar="N", help="0: any free port")] = 0,
) -> int:
    """Show runs in the browser: play, pause, scrub, compare."""
    return 0
