"""Routes of what there is to choose from: robots and planners; and of what the studio asks about a problem."""

from fastapi import APIRouter
from fastapi.responses import Response
from pydantic import Field

from optiplan.api.listings import planners, robots
from optiplan.resources import problems_dir
from optiplan.service.models import PlannerAnswer, ProblemInput, RobotAnswer, Text
from optiplan.service.refusals import not_found
from optiplan.service.routes.answers import Json, Kept, Service, errors

FILES = ("file:", ".csv", "mesh: ")
"""What a problem that needs a file has in its text."""

router = APIRouter(prefix="/api", default_response_class=Json)


class PoseRequest(ProblemInput):
    """A problem and a configuration of its robot."""

    q: list[float] = Field(max_length=200, description="Values of the planned joints, rad or m")


class IkRequest(ProblemInput):
    """A problem and a pose of a frame of its robot in the world."""

    pose: list[float] = Field(min_length=7, max_length=7, description="x, y, z (m) and quaternion x, y, z, w")
    near: list[float] | None = Field(None, max_length=200, description="The branch nearest to this comes first")
    frame: Text | None = Field(None, description="A link or fixed frame of the robot; its tool frame without one")


@router.get("/robots", response_model=list[RobotAnswer], responses=errors())
async def robots_listed(archive: Kept) -> Json:
    """The bundled robots."""
    found = await archive.read(robots)
    return Json([{"name": name, "about": about} for name, about in found.items()])


@router.get("/robots/{name}", response_model=RobotAnswer, responses=errors(404))
async def robot(name: str, archive: Kept) -> Json:
    """A bundled robot."""
    found = await archive.read(robots)
    if name not in found:
        raise not_found("robot", name)
    return Json({"name": name, "about": found[name]})


@router.get("/planners", response_model=list[PlannerAnswer], responses=errors())
async def planners_listed(archive: Kept) -> Json:
    """The planners."""
    found = await archive.read(planners)
    return Json([{"name": name, "about": about} for name, about in found.items()])


@router.get("/examples", responses=errors())
async def examples(service: Service) -> Json:
    """Texts of the example problems that need no file of their own, by name."""
    texts = {path.stem: path.read_text("utf-8") for path in sorted(problems_dir().glob("*.yaml"))}
    return Json({name: text for name, text in texts.items() if not any(word in text for word in FILES)})


@router.post("/scene", responses=errors(404, 413, 503))
async def scene(given: ProblemInput, service: Service) -> Response:
    """What a page draws of a problem, and which of it can be moved."""
    answer = await service.requests.ask(await service.requests.of(given), "scene")
    return Response(answer.files["scene.json"], media_type="application/json")


@router.post("/pose", responses=errors(404, 413, 503))
async def pose(given: PoseRequest, service: Service) -> Json:
    """Poses of the joints at a configuration, what touches there, and where the tool is."""
    answer = await service.requests.ask({**await service.requests.of(given), "q": given.q}, "pose")
    return Json(answer.data)


@router.post("/ik", responses=errors(404, 413, 503))
async def ik(given: IkRequest, service: Service) -> Json:
    """All branches of the inverse kinematics for a pose of a frame, the nearest first, with poses of the joints."""
    request = {**await service.requests.of(given), "pose": given.pose, "near": given.near, "frame": given.frame}
    answer = await service.requests.ask(request, "ik")
    return Json(answer.data)
