"""The page: our own template and scripts around meshcat's viewer, in one self-contained HTML file."""

import html
import json
from collections.abc import Sequence
from importlib import resources
from importlib.util import find_spec
from pathlib import Path
from string import Template

from optiplan.errors import OptiPlanError
from optiplan.files import write_text
from optiplan.problem.problem import Problem
from optiplan.viewer.runs import RunLike
from optiplan.viewer.scene import SceneData, build_scene


def render_page(scene: SceneData) -> str:
    """Return the self-contained page as text; names from the problem file are escaped."""
    own = resources.files("optiplan.viewer")
    meshcat = _meshcat()
    bundle = meshcat / "dist"
    licences = (bundle / "main.min.js.LICENSE.txt").read_text("utf-8")
    licence = (meshcat / "LICENSE").read_text("utf-8")
    return Template((own / "page.html").read_text("utf-8")).substitute(
        title=html.escape(scene.name),
        style=(own / "page.css").read_text("utf-8"),
        data=json.dumps(scene.to_dict(), separators=(",", ":")).replace("<", "\\u003c"),
        licences=f"meshcat: {licence}\n{licences}".replace("--", "- -"),
        meshcat=_inline((bundle / "main.min.js").read_text("utf-8")),
        shapes=(own / "shapes.js").read_text("utf-8"),
        paths=(own / "paths.js").read_text("utf-8"),
        ellipsoids=(own / "ellipsoids.js").read_text("utf-8"),
        scene=(own / "scene.js").read_text("utf-8"),
        player=(own / "player.js").read_text("utf-8"),
    )


def export_page(problem: Problem, runs: Sequence[RunLike], path: Path) -> None:
    """Write one standalone HTML file that plays the runs from a disk, without a network.

    `#t=0.6&paused` after its address shows one instant, standing still; `&ellipsoids` adds those of velocity and force.
    The file appears whole or not at all.
    """
    write_text(path, render_page(build_scene(problem, runs)))


def _meshcat() -> Path:
    """Folder of meshcat's JavaScript; located without importing it, which costs much time.

    Raises:
        OptiPlanError: meshcat is not installed.
    """
    found = find_spec("meshcat")
    if found is None or not found.origin:
        raise OptiPlanError("the viewer needs the package meshcat: pip install meshcat")
    return Path(found.origin).parent / "viewer"


def _inline(script: str) -> str:
    """Escape a script so that it cannot close its script tag."""
    return script.replace("</script", "<\\/script")
