"""Routes of motions that are executed: start one, watch it, steer it, stop it."""

from typing import Annotated, Any

from fastapi import APIRouter, Path
from fastapi.responses import Response
from sse_starlette.sse import EventSourceResponse

from optiplan.service.execution_models import (
    ExecutionAnswer,
    ExecutionList,
    ExecutionRequest,
    ExecutionState,
    ExecutionView,
    LatencyInput,
    ObstaclesInput,
    PredictedState,
    SpeedInput,
    SpliceAnswer,
    SpliceInput,
    StopInput,
)
from optiplan.service.routes.answers import PACKED, WATCHED, Json, Service, errors, recorded, watched
from optiplan.service.sessions.execution_sessions import PROOF, ExecutionSession

router = APIRouter(prefix="/api/executions", default_response_class=Json)

ExecutionPath = Annotated[str, Path(pattern="^[0-9a-f]{32}$", description="Id of an execution")]
STEERED = errors(404, 409, 413, 503)
"""What may go wrong with words to an execution."""


@router.post("", status_code=201, response_model=ExecutionAnswer, responses=errors(404, 409, 413, 503, 504))
async def start(given: ExecutionRequest, service: Service) -> Json:
    """Execute a verified motion by a driver of this server; a problem without a motion is planned first.

    It goes on without clients, unless a `lease` is asked for, to the end of the motion or to a stop. A driver moves one
    robot: a second execution on it is refused (409).
    """
    return Json(_answer(await service.executions.start(given)), 201)


@router.get("", response_model=ExecutionList, responses=errors())
async def executions(service: Service) -> Json:
    """The executions that run, then the last ones that ended, and the drivers of this server."""
    found = [_answer(session) for session in service.executions.all()]
    return Json({"executions": found, "drivers": list(service.executions.drivers)})


@router.get("/{execution}", response_model=ExecutionView, responses=errors(404))
async def one(execution: ExecutionPath, service: Service) -> Json:
    """An execution with its last state."""
    session = service.executions.get(execution)
    return Json({**_answer(session), "state": session.state})


@router.get("/{execution}/scene", responses=errors(404, 503))
async def scene(execution: ExecutionPath, service: Service) -> Response:
    """What a page draws of an execution: the scene and the motion that is executed now."""
    motion = service.executions.get(execution).motion
    answer = await service.requests.ask(motion, "scene")
    return Response(answer.files["scene.json"], media_type="application/json")


@router.get("/{execution}/recording.zip", response_class=Response, responses=PACKED)
async def recording(execution: ExecutionPath, service: Service) -> Response:
    """What was seen of the robot, the last ten minutes at most, as a run folder: `optiplan view` shows it."""
    session = service.executions.get(execution)
    return await recorded(service, session, session.motions[0], f"executed ({session.about['driver']})")


@router.get("/{execution}/events", response_class=EventSourceResponse, responses=WATCHED)
async def events(execution: ExecutionPath, service: Service) -> EventSourceResponse:
    """Watch an execution: `state`, as in its own answer, and `end` with a reason and whether it was `clean`."""
    return watched(service.executions.get(execution))


@router.post("/{execution}/override", response_model=ExecutionState, responses=STEERED)
async def override(execution: ExecutionPath, given: SpeedInput, service: Service) -> Json:
    """Set the wanted speed, from 0 to 1 of the planned one."""
    return await _steer(service, execution, "override", speed=given.speed)


@router.post("/{execution}/pause", response_model=ExecutionState, responses=STEERED)
async def pause(execution: ExecutionPath, service: Service) -> Json:
    """Stop along the path; `resume` and `reverse` go on."""
    return await _steer(service, execution, "pause")


@router.post("/{execution}/resume", response_model=ExecutionState, responses=STEERED)
async def resume(execution: ExecutionPath, service: Service) -> Json:
    """Go on forwards, at the wanted speed."""
    return await _steer(service, execution, "resume")


@router.post("/{execution}/reverse", response_model=ExecutionState, responses=STEERED)
async def reverse(execution: ExecutionPath, service: Service) -> Json:
    """Stop, and go back along the path to the last event of a task, or to the start."""
    return await _steer(service, execution, "reverse")


@router.post("/{execution}/stop", response_model=ExecutionState, responses=STEERED)
async def stop(execution: ExecutionPath, service: Service, given: StopInput | None = None) -> Json:
    """Stop along the path; the execution ends when the robot stands still, and the driver is free."""
    return await _steer(service, execution, "stop", reason=(given or StopInput()).reason)


@router.post("/{execution}/alive", response_model=ExecutionState, responses=STEERED)
async def alive(execution: ExecutionPath, service: Service) -> Json:
    """Renew the lease of an execution that has one."""
    return await _steer(service, execution, "alive")


@router.post("/{execution}/obstacles", response_model=ExecutionState, responses=STEERED)
async def obstacles(execution: ExecutionPath, given: ObstaclesInput, service: Service) -> Json:
    """Obstacles of the scene have moved: the rest of the path is checked, and the robot waits where it is blocked."""
    return await _steer(service, execution, "obstacles", **given.model_dump())


@router.post("/{execution}/state", response_model=PredictedState, responses=STEERED)
async def state(execution: ExecutionPath, given: LatencyInput, service: Service) -> Json:
    """The state some time from now, if nothing is changed until then: the start of a motion that is to take over."""
    return Json(await service.executions.get(execution).ask("state_in", latency=given.latency))


@router.post("/{execution}/splice", response_model=SpliceAnswer, responses=STEERED)
async def splice(execution: ExecutionPath, given: SpliceInput, service: Service) -> Json:
    """Let another motion take over in the state in which it begins; where that is not possible, the robot stops."""
    session = service.executions.get(execution)
    _, motion = await service.executions.motion(given)
    return Json(await session.ask("splice", PROOF, request=motion))


async def _steer(service: Service, execution: str, what: str, **given: Any) -> Json:
    return Json((await service.executions.get(execution).ask(what, **given))["state"])


def _answer(session: ExecutionSession) -> dict[str, Any]:
    return {"id": session.id, **session.about, "ended": session.ended, "clean": session.clean}
