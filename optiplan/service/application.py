"""The application: routes behind the gate, errors as data, started and stopped with its service."""

import asyncio
import logging
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from typing import Any

import sqlalchemy as sa
from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import HTMLResponse, Response
from starlette.exceptions import HTTPException
from starlette.types import ASGIApp

import optiplan
from optiplan.config.messages import expected_by
from optiplan.errors import OptiPlanError
from optiplan.service.guard.gate import REQUEST, Gate
from optiplan.service.guard.metrics import RequestCounts
from optiplan.service.guard.yaml_bodies import YamlBodies
from optiplan.service.pages.framing import error_page, wants_page
from optiplan.service.planner_service import PlannerService
from optiplan.service.refusals import Refusal, error_body, internal_error
from optiplan.service.routes import (
    benches,
    drawing,
    events,
    executions,
    health,
    live,
    pages,
    problems,
    robots,
    runs,
    uploads,
)
from optiplan.service.routes.answers import Json
from optiplan.service.routes.events import EventFeed
from optiplan.service.store.contents import StorageFullError
from optiplan.service.store.tables import DatabaseAwayError

TIDY = 600.0
"""s between two looks at what is too old."""
KEEPING = 3.0
"""s that runs which were answered have to be kept when the server stops."""
ABOUT = "Plans robot motions that are proved free of collision and within limits. Errors: `{error, issues}`."

_log = logging.getLogger("optiplan.service")


def make_application(service: PlannerService) -> ASGIApp:
    """The whole server as an ASGI application."""
    settings = service.settings
    app = FastAPI(
        title="OptiPlan",
        version=optiplan.__version__,
        description=ABOUT,
        docs_url=None,  # these pages load scripts from elsewhere
        redoc_url=None,
        root_path=settings.root_path,
        lifespan=_lifespan,
    )
    app.state.service, app.state.metrics, app.state.feed = service, RequestCounts(), EventFeed(service.archive)
    for room in (runs, problems, uploads, benches, robots, events, live, executions, drawing, health, pages):
        app.include_router(room.router)
    app.add_exception_handler(Refusal, _refused)
    app.add_exception_handler(OptiPlanError, _wrong)
    app.add_exception_handler(StorageFullError, _full)
    app.add_exception_handler(DatabaseAwayError, _database)
    app.add_exception_handler(sa.exc.TimeoutError, _database)
    app.add_exception_handler(RequestValidationError, _invalid)
    app.add_exception_handler(HTTPException, _http)
    app.add_exception_handler(Exception, _bug)
    return Gate(YamlBodies(app), settings, app.state.metrics)


@asynccontextmanager
async def _lifespan(app: FastAPI) -> AsyncIterator[None]:
    service: PlannerService = app.state.service
    await asyncio.to_thread(service.start)
    tidying = asyncio.ensure_future(_keep_tidy(service))
    try:
        yield
    finally:
        tidying.cancel()
        try:
            await asyncio.wait_for(service.waited.finish(), KEEPING)
        except Exception as error:
            _log.error("runs that were answered are not kept: %s", error or type(error).__name__)
        await asyncio.to_thread(service.close)


async def _keep_tidy(service: PlannerService) -> None:
    while True:
        try:
            await service.archive.write(service.tidy)
        except Exception as error:  # the next time may do better
            _log.warning("old runs cannot be deleted: %s", error)
        await asyncio.sleep(TIDY)


def _refused(request: Request, error: Any) -> Response:
    """Tell why: to a browser that asked for a page by a page, to programs by JSON."""
    path = request.url.path.removeprefix(request.scope.get("root_path", ""))
    if wants_page(request.method, path, request.headers.get("accept", "")):
        return HTMLResponse(error_page(error, path), error.status, headers=error.headers)
    return Json(error_body(error, error.issues), error.status, headers=error.headers)


def _wrong(request: Request, error: Any) -> Response:
    return _refused(request, Refusal(422, str(error), [vars(issue) for issue in getattr(error, "issues", ())]))


def _bug(request: Request, error: Any) -> Response:
    """Tell of a bug, which the gate logs under the id that it gives to the answer."""
    return _refused(request, internal_error(request.scope[REQUEST]))


def _full(request: Request, error: Any) -> Response:
    return _refused(request, Refusal(507, str(error)))


def _database(request: Request, error: Any) -> Response:
    if getattr(error, "full", False):
        return _refused(request, Refusal(507, "the disk of the database is full"))
    _log.error("%s", error)
    why = str(error) if isinstance(error, DatabaseAwayError) else "the database does not answer"
    return _refused(request, Refusal(503, why, headers={"Retry-After": "2"}))


def _invalid(request: Request, error: Any) -> Response:
    issues = []
    for item in error.errors():
        place = ".".join(str(part) for part in item["loc"])
        issues.append(
            {"file": "request", "line": None, "field": place, "found": _found(item), "expected": expected_by(item)}
        )
    broken = any(item["type"] == "json_invalid" for item in error.errors())
    text = "; ".join(f"{one['field']}: {one['found']}; expected {one['expected']}" for one in issues[:5])
    return _refused(request, Refusal(400 if broken else 422, text, issues))


def _found(item: Any) -> str:
    """What was found, in a few words."""
    if item["type"] in ("missing", "json_invalid"):
        return "nothing" if item["type"] == "missing" else "broken JSON"
    value = item.get("input")
    with suppress(Exception):
        text = " ".join(repr(value)[:200].split()) if not isinstance(value, dict | list) else type(value).__name__
        return text if len(text) <= 80 else text[:79] + "…"
    return type(value).__name__


def _http(request: Request, error: Any) -> Response:
    return _refused(request, Refusal(error.status_code, str(error.detail), headers=error.headers))
