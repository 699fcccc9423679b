"""Routes of what scripts draw by meshcat's protocol into the pages of runs: a stream, and the pictures of pages."""

import asyncio
from typing import Annotated

import anyio
from fastapi import APIRouter, Query, Request
from fastapi.responses import Response
from sse_starlette.sse import EventSourceResponse

from optiplan.service.planner_service import PlannerService
from optiplan.service.refusals import Refusal
from optiplan.service.routes.answers import Service
from optiplan.service.streams import Lines, event_stream, next_of
from optiplan.viewer.drawing.drawing import Drawing, picture_of

router = APIRouter(prefix="/api/drawing", include_in_schema=False)  # between our pages and this server


@router.get("", response_class=EventSourceResponse)
async def stream(service: Service) -> EventSourceResponse:
    """Watch what scripts draw: the scene so far, then every message; only with `--meshcat-port`."""
    drawing = _drawing(service)

    async def lines(stopping: anyio.Event) -> Lines:
        loop, news = asyncio.get_running_loop(), asyncio.Queue[None]()

        def wake() -> None:
            loop.call_soon_threadsafe(news.put_nowait, None)

        follower = drawing.follow(wake)
        try:
            while not (follower.lost or stopping.is_set()):
                if taken := follower.taken():
                    yield {"data": f"[{','.join(taken)}]"}
                else:
                    await next_of(news, stopping)
        finally:
            drawing.leave(follower)

    return event_stream(lines)


@router.post("", status_code=204)
async def picture(request: Request, service: Service, picture: Annotated[int, Query(ge=1, lt=2**53)]) -> Response:
    """Give the picture requested of a page: a `data:` address of a PNG file."""
    drawing, body = _drawing(service), await request.body()
    try:
        data = picture_of(body)
    except ValueError:
        raise Refusal(422, "the body is no data: address of a PNG file") from None
    if not drawing.give_picture(picture, data):
        raise Refusal(404, f"nobody waits for picture {picture}")
    return Response(status_code=204)


def _drawing(service: PlannerService) -> Drawing:
    if service.drawing is None:
        raise Refusal(404, "no script can draw here; `optiplan serve --meshcat-port 6000` lets them")
    return service.drawing
