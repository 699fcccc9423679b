"""Routes of pages for people, and of the client that a cell takes along."""

from importlib import resources
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, NamedTuple

from fastapi import APIRouter, Query
from fastapi.responses import Response

from optiplan.service.pages.framing import framed
from optiplan.service.refusals import not_found
from optiplan.service.routes.answers import HashPath, RunPath, Service, whole_page
from optiplan.viewer.assets import CURVES_SCRIPTS, CURVES_STYLES
from optiplan.viewer.assets import styles as viewer_styles

router = APIRouter(include_in_schema=False)


class Page(NamedTuple):
    """A page: heading, its scripts in their order, and the class of its body."""

    heading: str
    scripts: tuple[str, ...]
    kind: str = ""


TYPES = {".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".py": "text/x-python"}
SCENE = ("viewer", "common", "goal_frame", "gizmo", "scene_hand", "studio_scene")
"""Scripts of pages that draw a scene."""
EDITOR = ("codemirror", "problem_text", "pose_text", "schema_words", "editor")
"""Scripts of a page that edits the text of a problem."""
PAGES = {
    "": Page("OptiPlan", ("common", "home")),
    "studio": Page("OptiPlan studio", (*SCENE, *EDITOR, "drafts", "studio_card", "studio_run", "studio"), "studio"),
    "live": Page("OptiPlan live", (*SCENE, "strips", "live"), "studio live"),
    "execution": Page("OptiPlan execution", (*SCENE, "strips", "execution"), "studio live execution"),
    "benches": Page("OptiPlan benches", ("common", "benches")),
}
"""Pages by their address."""


@router.get("/runs/{run}")
async def run_page(run: RunPath, service: Service) -> Response:
    """The page of a run that has ended."""
    drawn = "../api/drawing" if service.drawing else ""
    return whole_page(await service.pictures.page(await service.archive.run(run), drawn=drawn), bool(drawn))


@router.get("/compare")
async def comparison(
    run: Annotated[list[str], Query(min_length=1, max_length=8)],
    service: Service,
    label: Annotated[list[str] | None, Query()] = None,
) -> Response:
    """One page of several runs of one problem, under the names of their planners or labels of their own."""
    drawn = "api/drawing" if service.drawing else ""
    records = [await service.archive.run(one) for one in run]
    return whole_page(await service.pictures.page(*records, labels=label or (), drawn=drawn), bool(drawn))


@router.get("/api/runs/{run}/thumbnail.svg")
async def run_picture(run: RunPath, service: Service) -> Response:
    """The scene of a run, with its motion, as a small picture."""
    return _picture(await service.pictures.of_run(await service.archive.run(run)))


@router.get("/api/problems/{hash}/thumbnail.svg")
async def problem_picture(hash: HashPath, service: Service) -> Response:
    """The scene of a stored problem as a small picture."""
    return _picture(await service.pictures.of_problem(hash))


@router.get("/pages/viewer.js")
async def viewer() -> Response:
    """What draws: meshcat's bundle, and the viewer's shapes and curves."""
    web = Path(str(resources.files("optiplan.viewer"))) / "web"
    ours = [web / name for name in ("packed.js", "scene/shapes.js", "scene/objects.js", *CURVES_SCRIPTS)]
    found = find_spec("meshcat")
    if found is None or not found.origin:
        raise not_found("package", "meshcat")
    bundle = Path(found.origin).parent / "viewer" / "dist" / "main.min.js"
    texts = [path.read_text("utf-8") for path in (bundle, *ours)]
    return Response("\n;".join(texts), media_type="text/javascript; charset=utf-8")


@router.get("/pages/codemirror.js")
async def codemirror() -> Response:
    """The editor's bundle; beside it lie its licences, and how it is made."""
    return _file("optiplan.service.pages.codemirror", "codemirror.min.js")


@router.get("/cell.py")
async def cell() -> Response:
    """The client for cells, one file."""
    return _file("optiplan.service", "cell.py")


@router.get("/pages/service.css")
async def styles() -> Response:
    """The theme and the curves of all pages, and what those of the service add."""
    text = viewer_styles(CURVES_STYLES) + (resources.files("optiplan.service.pages") / "service.css").read_text("utf-8")
    return Response(text, media_type="text/css; charset=utf-8")


@router.get("/pages/{name}")
async def page_file(name: str) -> Response:
    """A script or style of the pages."""
    return _file("optiplan.service.pages", name)


@router.get("/{name}")
@router.get("/")
async def page(name: str = "") -> Response:
    """A page."""
    if name not in PAGES:
        raise not_found("page", name)
    shown = PAGES[name]
    content = (resources.files("optiplan.service.pages") / f"{name or 'home'}.html").read_text("utf-8")
    text = framed(shown.heading, name, content, shown.scripts, shown.kind)
    return Response(text, media_type="text/html; charset=utf-8")


def _picture(drawn: bytes) -> Response:
    return Response(drawn, media_type="image/svg+xml", headers={"Cache-Control": "private, max-age=86400"})


def _file(package: str, name: str) -> Response:
    kind = next((kind for ending, kind in TYPES.items() if name.endswith(ending)), None)
    found = resources.files(package) / name
    if kind is None or "/" in name or not found.is_file():
        raise not_found("page", name)
    return Response(found.read_bytes(), media_type=f"{kind}; charset=utf-8")
