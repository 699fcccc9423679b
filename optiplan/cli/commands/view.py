"""`optiplan view`: runs in the browser, or as a page, a picture or a film to send."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from optiplan.cli.options import Port, refuse
from optiplan.cli.output import say
from optiplan.errors import InputError, Issue
from optiplan.files import write_text

if TYPE_CHECKING:
    from optiplan.problem.problem import Problem
    from optiplan.viewer.runs import ViewedRun

ADDRESS = (
    *("t", "paused", "speed", "cam", "layers", "run", "runs", "tab", "panel", "theme"),
    *("scene", "arrange", "hide", "pin", "of", "multiples", "signals"),
    *("through", "trail", "frames", "ellipsoids", "view", "ghosts"),
)
"""What may stand after the page's #."""


def view(
    runs: Annotated[list[Path], typer.Argument(metavar="RUN…", help="run folders of one robot")],
    export: Annotated[
        Path | None, typer.Option(metavar="FILE", help="write PAGE.html, FILE.mcap or FILE.rrd, serve nothing")
    ] = None,
    png: Annotated[Path | None, typer.Option(metavar="FILE.png", help="write a picture of the page")] = None,
    gif: Annotated[
        Path | None, typer.Option(metavar="FILE.gif", help="write a film of the scene (or FILE.webp, FILE.mp4)")
    ] = None,
    at: Annotated[str | None, typer.Option(metavar="ADDRESS", help="what pictures show, as after the page's #")] = None,
    size: Annotated[str | None, typer.Option(metavar="WxH", help="size of pictures, px (default: 1280x800)")] = None,
    port: Port = None,
    meshcat_port: Annotated[
        int | None, typer.Option(min=0, max=65535, metavar="N", help="where meshcat's scripts draw (6000; 0: any)")
    ] = None,
) -> int:
    """Show runs in the browser: motion, curves against limits, clearance, verdict.

    Several runs play together, in turn or side by side; of different problems each with its own obstacles.

    An exported page needs no network and no OptiPlan; `#t=0.6&paused` behind its address shows one instant.
    With --meshcat-port, meshcat.Visualizer and Pinocchio's MeshcatVisualizer draw into the page.
    FILE.mcap opens in Foxglove, FILE.rrd in Rerun: scene, motion, curves and verdict of one run (extra `recordings`).
    Pictures and films need chromium and the extra `pictures`, FILE.mp4 also ffmpeg.

    [bold]Examples[/]

      optiplan view runs/shelf

      optiplan view runs/trajopt runs/rrtconnect --export compare.html

      optiplan view runs/shelf --meshcat-port 6000

      optiplan view runs/shelf --export shelf.mcap

      optiplan view runs/shelf --png shelf.png --at "t=0.4&tab=jerk"

      optiplan view runs/shelf --gif shelf.gif --at "speed=0.25" --size 800x500
    """
    from optiplan.cli.viewing import open_runs, serve_page
    from optiplan.viewer.page import render_page
    from optiplan.viewer.pictures import save_film, save_picture
    from optiplan.viewer.recordings.formats import FORMATS as RECORDINGS
    from optiplan.viewer.scene import build_scene
    from optiplan.viewer.server import FIRST_PORT

    wanted = {"export": export, "png": png, "gif": gif}
    _check(wanted, meshcat_port)
    pixels, address = _pixels(size or "1280x800"), _address(at or "")
    if png is None and gif is None:
        refuse({"--at": at, "--size": size}, "goes with --png or --gif")
    if any(wanted.values()):
        refuse({"--port": port}, "serves the page; beside --export, --png and --gif nothing is served")
    problem, shown = open_runs(runs)
    if not any(wanted.values()):
        serve_page(problem, shown, FIRST_PORT if port is None else port, meshcat_port)
        return 0
    if export is not None and export.suffix.lower() in RECORDINGS:
        _record(problem, shown, export)
        del wanted["export"]
        if not any(wanted.values()):
            return 0
    page = render_page(build_scene(problem, shown))
    for name, path in wanted.items():
        if path is None:
            continue
        if name == "export":
            write_text(path, page)
        elif name == "png":
            save_picture(page, path, address, pixels)
        else:
            save_film(page, path, address, pixels)
        say(f"written: {path}")
    return 0


def _record(problem: "Problem", shown: "Sequence[ViewedRun]", path: Path) -> None:
    """Write a recording of one run."""
    from optiplan.viewer.recordings.formats import save_recording

    if len(shown) > 1:
        expected = "one run; a page (PAGE.html) takes several"
        raise InputError([Issue("view", None, "export", f"{len(shown)} runs", expected)])
    save_recording(problem, shown[0], path)
    say(f"written: {path}")


def _check(wanted: dict[str, Path | None], meshcat_port: int | None) -> None:
    """Raise InputError where a file to write is a folder, its name does not fit, or scripts would draw into a file."""
    suffixes = {"export": (".html", ".htm", ".mcap", ".rrd"), "png": (".png",), "gif": (".gif", ".webp", ".mp4")}
    issues = []
    if meshcat_port is not None and any(wanted.values()):
        issues.append(Issue("view", None, "meshcat-port", "a file to write", "no --export, --png and --gif beside it"))
    for name, path in wanted.items():
        if path is not None and path.is_dir():
            issues.append(Issue(str(path), None, name, "is a folder", "a file to write, such as page.html"))
        elif path is not None and path.suffix.lower() not in suffixes[name]:
            found = f"a name that ends with '{path.suffix}'"
            issues.append(Issue(str(path), None, name, found, " or ".join(suffixes[name])))
    if issues:
        raise InputError(issues)


def _pixels(size: str) -> tuple[int, int]:
    found = re.fullmatch(r"(\d{2,4})x(\d{2,4})", size)
    if found is None:
        raise InputError([Issue("view", None, "size", f"'{size}'", "width x height in px, such as 1280x800")])
    return int(found[1]), int(found[2])


def _address(at: str) -> str:
    """Return what stands after the page's #, after a check of what it says."""
    at = at.removeprefix("#")
    said = [part.partition("=")[0] for part in at.split("&") if part]
    unknown = [key for key in said if key not in ADDRESS]
    if unknown:
        expected = f"such as t=0.4&tab=jerk; what may be said: {', '.join(ADDRESS)}"
        raise InputError([Issue("view", None, "at", f"'{unknown[0]}'", expected)])
    return at
