"""Routes of benches: problems by planners by seeds, as runs of the queue."""

from typing import Annotated

from fastapi import APIRouter, Path
from fastapi.responses import Response

from optiplan.service.models import BenchAnswer, BenchRequest
from optiplan.service.routes.answers import Json, Service, errors, files, whole_page

router = APIRouter(prefix="/api/benches", default_response_class=Json)

BenchPath = Annotated[str, Path(pattern="^[0-9a-f]{32}$", description="Id of a bench")]


@router.post("", status_code=202, response_model=BenchAnswer, responses=errors(404, 413, 503, 507))
async def submit(given: BenchRequest, service: Service) -> Json:
    """Queue every problem with every planner and seed; a run that there is already is not made again."""
    return Json(await service.benches.submit(given), 202)


@router.get("", response_model=list[BenchAnswer], responses=errors())
async def listed(service: Service) -> Json:
    """The last benches."""
    return Json(await service.benches.all())


@router.get("/{bench}", response_model=BenchAnswer, responses=errors(404))
async def one(bench: BenchPath, service: Service) -> Json:
    """A bench: how far it is, and the figures of each planner and of each problem with each planner."""
    return Json(await service.benches.one(bench))


@router.get("/{bench}/report.html", response_class=Response, responses=files("text/html") | errors(404, 503))
async def report(bench: BenchPath, service: Service) -> Response:
    """The report of a bench as one page: matrix with pictures, tables, quality against time."""
    return whole_page(await service.benches.report(bench))


@router.post("/{bench}/cancel", response_model=BenchAnswer, responses=errors(404))
async def cancel(bench: BenchPath, service: Service) -> Json:
    """Cancel what of a bench has not ended."""
    await service.benches.cancel(bench)
    return Json(await service.benches.one(bench))


@router.delete("/{bench}", status_code=204, responses=errors(404))
async def delete(bench: BenchPath, service: Service) -> Response:
    """Forget a bench; its runs stay."""
    await service.benches.delete(bench)
    return Response(status_code=204)
