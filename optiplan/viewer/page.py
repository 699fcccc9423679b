"""The page: our own template and scripts around meshcat's viewer, in one self-contained HTML file."""

import html
import json
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from string import Template
from typing import NamedTuple

from optiplan.errors import OptiPlanError
from optiplan.files import write_text
from optiplan.problem.problem import Problem
from optiplan.viewer.assets import CURVES_SCRIPTS, CURVES_STYLES, asset, inline, licence, scripts, styles
from optiplan.viewer.runs import RunLike
from optiplan.viewer.scene import SceneData, build_scene

SCENE_SCRIPTS = tuple(
    f"scene/{name}.js"
    for name in (
        "shapes",
        "paths",
        "ellipsoids",
        "stage",
        "camera",
        "outlines",
        "bodies",
        "objects",
        "arrangement",
        "rod",
        "failure",
        "scene",
    )
)
PANEL_SCRIPTS = tuple(
    f"panels/{name}.js"
    for name in ("attempts", "verdict", "comparison", "dock", "timeline", "steps", "layers", "pictures")
)
SCRIPTS = ("packed.js", "panels/facts.js", *CURVES_SCRIPTS, *SCENE_SCRIPTS, *PANEL_SCRIPTS, "address.js", "player.js")


class Back(NamedTuple):
    """A link from the page to where it was opened from: its address, and its words."""

    address: str
    words: str


def render_page(scene: SceneData, back: Back | tuple[str, str] | None = None) -> str:
    """Return the self-contained page as text; names from the problem file are escaped."""
    return Template(asset("page.html")).substitute(
        title=html.escape(scene.name),
        styles=styles((*CURVES_STYLES, "page.css")),
        back="" if back is None else f'<a href="{html.escape(back[0])}">{html.escape(back[1])}</a>\n',
        data=json.dumps(scene.to_dict(), separators=(",", ":")).replace("<", "\\u003c"),
        licences=f"{meshcat_licences()}\nuPlot: {licence('uplot/LICENSE.txt')}",
        meshcat=meshcat_script(),
        scripts=scripts(SCRIPTS),
    )


def export_page(
    problem: Problem, runs: Sequence[RunLike], path: Path, back: Back | tuple[str, str] | None = None
) -> None:
    """Write one standalone HTML file that plays the runs from a disk, without a network.

    `#t=0.6&paused` after its address shows one instant, standing still; `&ellipsoids` adds those of velocity and force.
    The file appears whole or not at all.
    """
    write_text(path, render_page(build_scene(problem, runs), back))


def meshcat_script() -> str:
    """Return meshcat's JavaScript, three.js included, for a `<script>` element."""
    return inline((_meshcat() / "dist" / "main.min.js").read_text("utf-8"))


def meshcat_licences() -> str:
    """Return the licences of meshcat's JavaScript, for an HTML comment."""
    own = (_meshcat() / "LICENSE").read_text("utf-8")
    others = (_meshcat() / "dist" / "main.min.js.LICENSE.txt").read_text("utf-8")
    return f"meshcat: {own}\n{others}".replace("--", "- -")


def _meshcat() -> Path:
    """Folder of meshcat's JavaScript; located without importing it, which costs much time.

    Raises:
        OptiPlanError: meshcat is not installed.
    """
    found = find_spec("meshcat")
    if found is None or not found.origin:
        raise OptiPlanError("the viewer needs the package meshcat: pip install meshcat")
    return Path(found.origin).parent / "viewer"
