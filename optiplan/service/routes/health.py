"""Routes for whoever runs the server: is it there, can it work, how is it doing."""

from fastapi import APIRouter, Request
from fastapi.responses import PlainTextResponse

from optiplan.service.guard.metrics import RequestCounts
from optiplan.service.routes.answers import Json, Service, errors

router = APIRouter(default_response_class=Json)


@router.get("/healthz")
async def alive() -> Json:
    """The server answers."""
    return Json({"status": "ok"})


@router.get("/readyz", responses=errors(503))
async def ready(service: Service) -> Json:
    """The database answers and the processes are warm."""
    await service.read(service.runs.waiting)
    if not service.pool.ready:
        return Json({"error": "processes are starting", "issues": []}, 503)
    return Json({"status": "ok"})


@router.get("/metrics", response_class=PlainTextResponse, responses=errors())
async def metrics(service: Service, request: Request) -> PlainTextResponse:
    """Counts for Prometheus."""
    counts: RequestCounts = request.app.state.metrics
    pool = service.pool
    gauges = {"solver_memory_megabytes": pool.memory(), "callers_waiting": pool.waiting("plan") + pool.waiting("look")}
    text = counts.text(gauges, await service.read(service.runs.counts))
    return PlainTextResponse(text, media_type="text/plain; version=0.0.4")
