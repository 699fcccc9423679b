"""Routes of pages for people, and of the client that a cell takes along."""

from importlib import resources

from fastapi import APIRouter
from fastapi.responses import Response

from optiplan.service.refusals import not_found
from optiplan.service.routes.answers import RunPath, Service
from optiplan.viewer.safety import PAGE_POLICY

router = APIRouter(include_in_schema=False)

TYPES = {".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".py": "text/x-python"}
PAGES = {"": "home.html", "studio": "studio.html"}


@router.get("/runs/{run}")
async def run_page(run: RunPath, service: Service) -> Response:
    """The page of a run that has ended."""
    page = await service.page(await service.run(run))
    headers = {"Content-Security-Policy": PAGE_POLICY}
    return Response(page, media_type="text/html; charset=utf-8", headers=headers)


@router.get("/cell.py")
async def cell() -> Response:
    """The client for cells, one file."""
    return _file("optiplan.service", "cell.py")


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
    return _file("optiplan.service.pages", PAGES[name])


def _file(package: str, name: str) -> Response:
    kind = next((kind for ending, kind in TYPES.items() if name.endswith(ending)), None)
    found = resources.files(package) / name
    if kind is None or "/" in name or not found.is_file():
        raise not_found("page", name)
    return Response(found.read_bytes(), media_type=f"{kind}; charset=utf-8")
