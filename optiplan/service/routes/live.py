"""Routes of controllers that run: start one, watch its states, move its target, stop it."""

from typing import Annotated, Any

from fastapi import APIRouter, Path
from fastapi.responses import Response
from sse_starlette.sse import EventSourceResponse

from optiplan.service.models import LiveAnswer, LiveRequest, LiveTarget, LiveView
from optiplan.service.routes.answers import PACKED, WATCHED, Json, Service, errors, recorded, watched
from optiplan.service.sessions.live_sessions import LiveSession

router = APIRouter(prefix="/api/live", default_response_class=Json)

SessionPath = Annotated[str, Path(pattern="^[0-9a-f]{32}$", description="Id of a controller that runs")]


@router.post("", status_code=201, response_model=LiveAnswer, responses=errors(404, 413, 503))
async def start(given: LiveRequest, service: Service) -> Json:
    """Start the task-space controller above a simulated robot, at the start of a problem.

    The tool's pose there is the first target. It stops when it is told to, or when nobody has watched for half a
    minute.
    """
    return Json(_answer(await service.live.start(given)), 201)


@router.get("", response_model=list[LiveAnswer], responses=errors())
async def running(service: Service) -> Json:
    """The controllers that run."""
    return Json([_answer(session) for session in service.live.all()])


@router.get("/{session}", response_model=LiveView, responses=errors(404))
async def one(session: SessionPath, service: Service) -> Json:
    """A controller that runs, with its problem, so that others can watch it too."""
    found = service.live.get(session)
    return Json({**_answer(found), "problem": found.problem})


@router.get("/{session}/recording.zip", response_class=Response, responses=PACKED)
async def recording(session: SessionPath, service: Service) -> Response:
    """What was seen of the robot, the last ten minutes at most, as a run folder: `optiplan view` shows it.

    Of a controller that runs, or of the last that ended.
    """
    found = service.live.seen(session)
    return await recorded(service, found, found.request, f"controller ({found.about['engine']})")


@router.get("/{session}/events", response_class=EventSourceResponse, responses=WATCHED)
async def events(session: SessionPath, service: Service) -> EventSourceResponse:
    """Watch a controller: `state` (joints, poses, tool, target, errors, status, nearest pair), `end` with a reason."""
    return watched(service.live.get(session))


@router.post("/{session}/target", status_code=204, responses=errors(404, 413))
async def aim(session: SessionPath, target: LiveTarget, service: Service) -> Response:
    """Move the target; the controller follows within its limits and clear of everything."""
    service.live.get(session).aim(target.pose)
    return Response(status_code=204)


@router.delete("/{session}", status_code=204, responses=errors(404))
async def stop(session: SessionPath, service: Service) -> Response:
    """Stop a controller."""
    service.live.get(session).stop()
    return Response(status_code=204)


def _answer(session: LiveSession) -> dict[str, Any]:
    return {"id": session.id, **session.about}
