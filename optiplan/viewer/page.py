"""The page: our own template and scripts around meshcat's viewer, in one self-contained HTML file."""

import html
import json
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from string import Template
from typing import Any, NamedTuple

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
        "drawing",
        "scene",
    )
)
PANEL_SCRIPTS = tuple(
    f"panels/{name}.js"
    for name in (
        "attempts",
        "verdict",
        "comparison",
        "derived",
        "dock",
        "timeline",
        "steps",
        "layers",
        "picked",
        "pictures",
    )
)
SCRIPTS = ("packed.js", "panels/facts.js", *CURVES_SCRIPTS, *SCENE_SCRIPTS, *PANEL_SCRIPTS, "address.js", "player.js")


class Link(NamedTuple):
    """A link from the page: its address, and its words."""

    address: str
    words: str


class Drawn(NamedTuple):
    """What scripts draw into a page: messages so far, `[command, path, base64]`, and where more come from."""

    messages: Sequence[Sequence[str]] = ()
    address: str = ""


def render_page(
    scene: SceneData, back: Link | tuple[str, str] | None = None, more: Sequence[Link] = (), drawn: Drawn | None = None
) -> str:
    """Return the self-contained page as text; names from the problem file are escaped.

    Args:
        scene: what is drawn.
        back: where the page was opened from.
        more: links to what else can be done with its runs.
        drawn: what scripts draw into it.
    """
    body = Template(asset("page.html")).substitute(
        title=html.escape(scene.name),
        back="" if back is None else _anchor(Link(*back)) + "\n",
        more="".join(map(_anchor, more)),
    )
    data = scene.to_dict() | ({} if drawn is None else {"drawn": drawn._asdict()})
    connect = "connect-src 'self'" if drawn is not None and drawn.address else "connect-src 'none'"
    return framed(body, scene.name, data, (*CURVES_STYLES, "page.css"), SCRIPTS, connect)


def _anchor(link: Link) -> str:
    """Links leave the frame that another page may have put this one into."""
    return f'<a href="{html.escape(link.address)}" target="_top">{html.escape(link.words)}</a>'


def framed(
    body: str,
    title: str,
    data: Mapping[str, Any],
    style_names: Sequence[str],
    names: Sequence[str],
    connect: str = "connect-src 'none'",
) -> str:
    """Return a self-contained page that draws with meshcat.

    Args:
        body: HTML from `<body>` on, without the end.
        title: of the page, as plain text.
        data: JSON-ready, for the scripts.
        style_names: files of `web/`.
        names: scripts of `web/`, in their order.
        connect: the part of the content policy that says where the page may get more from.
    """
    meshcat = _meshcat()
    texts = [(meshcat / name).read_text("utf-8") for name in ("LICENSE", "dist/main.min.js.LICENSE.txt")]
    curves = f"\nuPlot: {licence('uplot/LICENSE.txt')}" if set(CURVES_SCRIPTS) <= set(names) else ""
    return Template(asset("frame.html")).substitute(
        title=html.escape(title),
        connect=connect,
        styles=styles(style_names),
        body=body,
        data=json.dumps(data, separators=(",", ":")).replace("<", "\\u003c"),
        licences=f"meshcat: {texts[0]}\n{texts[1]}".replace("--", "- -") + curves,
        meshcat=inline((meshcat / "dist" / "main.min.js").read_text("utf-8")),
        scripts=scripts(names),
    )


def export_page(
    problem: Problem, runs: Sequence[RunLike], path: Path, back: Link | tuple[str, str] | None = None
) -> None:
    """Write one standalone HTML file that plays the runs from a disk, without a network.

    `#t=0.6&paused` after its address shows one instant, standing still; `&ellipsoids` adds those of velocity and force.
    The file appears whole or not at all.
    """
    write_text(path, render_page(build_scene(problem, runs), back))


def _meshcat() -> Path:
    """Folder of meshcat's JavaScript; located without importing it, which costs much time.

    Raises:
        OptiPlanError: meshcat is not installed.
    """
    found = find_spec("meshcat")
    if found is None or not found.origin:
        raise OptiPlanError("the viewer needs the package meshcat: pip install meshcat")
    return Path(found.origin).parent / "viewer"
