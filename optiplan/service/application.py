"""The application: routes behind the gate, errors as data, started and stopped with its service."""

import asyncio
import logging
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import sqlalchemy as sa
from fastapi import Depends, FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import HTMLResponse, Response
from pydantic import BaseModel
from starlette.exceptions import HTTPException
from starlette.types import ASGIApp

import optiplan
from optiplan.config.document import Document, pydantic_issues
from optiplan.errors import OptiPlanError
from optiplan.service.guard.gate import REQUEST, Gate
from optiplan.service.guard.metrics import RequestCounts
from optiplan.service.guard.yaml_bodies import YamlBodies
from optiplan.service.pages.framing import error_page, wants_page
from optiplan.service.planner_service import PlannerService
from optiplan.service.refusals import Refusal, error_body, internal_error, not_found
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
from optiplan.service.routes.answers import Json, known_query
from optiplan.service.routes.events import EventFeed
from optiplan.service.store.contents import StorageFullError
from optiplan.service.store.tables import DatabaseAwayError

TIDY = 600.0
"""s between two looks at what is too old."""
KEEPING = 3.0
"""s that runs which were answered have to be kept when the server stops."""
ABOUT = "Plans robot motions that are proved free of collision and within limits. Errors: `{error, issues}`."

BROKEN = "json_invalid"
"""Pydantic's type of an error of a body that is no JSON."""

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
        app.include_router(room.router, dependencies=[] if room is pages else [Depends(known_query)])
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
    """Tell all that does not fit the schema of a route; a path that names nothing is not there."""
    items = [_retold(item, request) for item in error.errors()]
    for where, *name in (item["loc"] for item in items):
        if where == "path":
            what, found = name[0], request.path_params[name[0]]
            return _refused(request, not_found("problem" if what == "hash" else what, found))
    data = {"query": dict(request.query_params), "Content-Type": ""}
    data |= {} if error.body is None else {"body": error.body}
    body = request.scope["route"].body_field
    model = body.field_info.annotation if body else BaseModel
    issues = pydantic_issues(model, Document(Path("request"), data, {}), items)
    text = "; ".join(f"{one.field}: {one.found}; expected {one.expected}" for one in issues[:5])
    broken = any(item["type"] == BROKEN for item in error.errors())
    return _refused(request, Refusal(400 if broken else 422, text, [vars(one) for one in issues]))


def _retold(item: Any, request: Request) -> Any:
    """An error of pydantic about a whole body in our words: it is broken, or was sent as what it is not."""
    kind = request.headers.get("content-type", "nothing").partition(";")[0]
    if item["type"] == BROKEN:
        place, words = ("body",), f"found broken JSON ({item['ctx']['error']}); expected JSON"
    elif item["loc"] == ("body",) and not kind.endswith("json"):
        place = ("Content-Type",)
        words = f"found {kind}; expected application/json, or application/yaml for the text of a problem file"
    else:
        return item
    return {**item, "type": "value_error", "loc": place, "ctx": {"error": words}}


def _http(request: Request, error: Any) -> Response:
    return _refused(request, Refusal(error.status_code, str(error.detail), headers=error.headers))
