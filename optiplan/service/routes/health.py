"""Routes for whoever runs the server: is it there, can it work, how is it doing."""

import asyncio

from fastapi import APIRouter, Request
from fastapi.responses import PlainTextResponse

from optiplan.service.guard.metrics import RequestCounts
from optiplan.service.routes.answers import Json, Service, errors

router = APIRouter(default_response_class=Json)


@router.get("/healthz", responses=errors(503))
async def alive(service: Service) -> Json:
    """The server answers, and the threads without which it could not work live."""
    status, body = service.health.living()
    return Json(body, status)


@router.get("/readyz", responses=errors(503))
async def ready(service: Service) -> Json:
    """Threads live, processes are warm, database and disk take changes."""
    status, body = await asyncio.to_thread(service.health.ready)
    return Json(body, status)


@router.get("/metrics", response_class=PlainTextResponse, responses=errors())
async def metrics(service: Service, request: Request) -> PlainTextResponse:
    """Counts for Prometheus."""
    counts: RequestCounts = request.app.state.metrics
    pool = service.pool
    gauges = {"solver_memory_megabytes": pool.memory(), "callers_waiting": pool.waiting("plan") + pool.waiting("look")}
    gauges |= {"executions_running": service.executions.running, "executions_unclean": service.executions.unclean}
    text = counts.text(gauges, await service.archive.read(service.archive.runs.counts))
    return PlainTextResponse(text, media_type="text/plain; version=0.0.4")
