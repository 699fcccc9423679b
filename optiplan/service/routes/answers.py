"""Answers as routes give them, and what may go wrong with each, for OpenAPI."""

import io
import json
import zipfile
from collections.abc import Iterable, Mapping
from pathlib import Path as FilePath
from typing import Annotated, Any

import anyio
from fastapi import Depends, Path, Request
from fastapi.responses import JSONResponse, Response
from sse_starlette.sse import EventSourceResponse

from optiplan.config.document import parse_yaml
from optiplan.config.messages import choices, one_line
from optiplan.errors import InputError, Issue
from optiplan.service.archive import Archive, has_page
from optiplan.service.models import ErrorAnswer, RunAnswer
from optiplan.service.planner_service import PlannerService
from optiplan.service.refusals import Refusal
from optiplan.service.sessions.sessions import Session
from optiplan.service.store.run_table import Record
from optiplan.service.streams import Lines, event_stream
from optiplan.viewer.safety import DRAWN_POLICY, PAGE_POLICY

ERRORS = {
    400: "the body is not JSON",
    401: "the token is missing or wrong",
    403: "called by a foreign name, or from a foreign page",
    404: "there is no such thing",
    409: "not in this state",
    413: "the body is too large",
    422: "the input is wrong; `issues` has everything that is",
    429: "too much is asked for; Retry-After says when to try again",
    503: "not now; try again",
    504: "no answer before the deadline",
    507: "the disk is full",
}
"""Statuses of errors, and what they mean."""

Responses = dict[int | str, dict[str, Any]]


def errors(*statuses: int) -> Responses:
    """The errors of a route, with those of every route."""
    of_every_route = (400, 401, 403, 422, 429)
    return {status: {"model": ErrorAnswer, "description": ERRORS[status]} for status in (*statuses, *of_every_route)}


def files(*kinds: str) -> Responses:
    """The answer of a route that gives a file of one of these media types."""
    return {200: {"description": "The file", "content": {kind: {} for kind in kinds}}}


PACKED = files("application/zip") | errors(404, 409, 503)
"""Of a route that packs what was seen of a session."""

WATCHED: Responses = errors(404) | {
    200: {"content": {"text/event-stream": {}}, "description": "state, 25 times a second; end"}
}
"""Of a route that streams the events of a session."""


def service(request: Request) -> PlannerService:
    """The service behind the application."""
    found: PlannerService = request.app.state.service
    return found


def archive(request: Request) -> Archive:
    """What that service keeps."""
    return service(request).archive


def known_query(request: Request) -> None:
    """Check that a route knows every key of the query.

    Raises:
        InputError: it does not: what nobody reads would be left out without a word.
    """
    valid = [one.alias for one in request.scope["route"].dependant.query_params]
    issues = [
        Issue("request", None, "query", one_line(f"unknown key '{key}'"), choices(key, valid) if valid else "no query")
        for key in request.query_params
        if key not in valid
    ]
    if issues:
        raise InputError(issues)


Service = Annotated[PlannerService, Depends(service)]
Kept = Annotated[Archive, Depends(archive)]
RunPath = Annotated[str, Path(pattern="^[0-9a-f]{32}$", description="Id of a run")]
HashPath = Annotated[str, Path(pattern="^[0-9a-f]{64}$", description="Hash of a stored problem")]


class Json(JSONResponse):
    """JSON in ASCII: whatever characters somebody sent, the answer can be sent."""

    def render(self, content: Any) -> bytes:
        """The bytes."""
        return json.dumps(content, allow_nan=False, separators=(",", ":")).encode()


def zipped(contents: Mapping[str, bytes]) -> Response:
    """Return files by their names as one."""
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as packing:
        for name, content in contents.items():
            packing.writestr(name, content)
    return Response(packed.getvalue(), media_type="application/zip")


async def recorded(service: PlannerService, session: Session, problem: Mapping[str, Any], by: str) -> Response:
    """Return what was seen of a session, as a run folder.

    Raises:
        Refusal: there is nothing yet.
    """
    asked = session.seen.request(by)
    if asked is None:
        raise Refusal(409, f"nothing has been seen of '{session.id}' yet")
    return zipped((await service.requests.ask({**problem, **asked}, "recording")).files)


def watched(session: Session) -> EventSourceResponse:
    """Return the events of a session as they come."""

    async def lines(stopping: anyio.Event) -> Lines:
        async for event in session.events(stopping):
            yield {"event": event["type"], "data": json.dumps(event, allow_nan=False)}

    return event_stream(lines)


def problem_of(request: Record) -> str | dict[str, Any]:
    """Return the problem of a stored request with the `start`, `goal` and `name` that it was submitted with.

    The text as it came where the request has none of them, else the data.
    """
    given: str | dict[str, Any] = request["problem"]
    instead = {key: request[key] for key in ("name", "start", "goal") if request.get(key) is not None}
    if not instead:
        return given
    data = parse_yaml(given, FilePath("problem.yaml")).data if isinstance(given, str) else given
    if "name" in data:  # another one is for problems without
        instead.pop("name", None)
    return {**data, **instead} if instead else given


def whole_page(page: bytes, drawn: bool = False) -> Response:
    """Return a page with everything inside it, which may load nothing from anywhere, but what scripts draw."""
    policy = DRAWN_POLICY if drawn else PAGE_POLICY
    return Response(page, media_type="text/html; charset=utf-8", headers={"Content-Security-Policy": policy})


def run_answer(record: Record) -> dict[str, Any]:
    """A run as `RunAnswer` says."""
    return {key: record.get(key) for key in RunAnswer.model_fields} | {"page": has_page(record)}


def run_answers(records: Iterable[Record]) -> list[dict[str, Any]]:
    """Runs as `RunAnswer` says."""
    return [run_answer(record) for record in records]
