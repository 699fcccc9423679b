"""Routes of problems: check, store, look, delete; and the files that problems name."""

import json
from typing import Annotated, Any

from fastapi import APIRouter, Query
from fastapi.responses import Response

from optiplan.problem.schema.problem import problem_schema
from optiplan.service.models import CheckAnswer, ProblemAnswer, ProblemInput
from optiplan.service.refusals import Refusal, not_found
from optiplan.service.routes.answers import HashPath, Json, Kept, Service, errors, problem_of

router = APIRouter(prefix="/api", default_response_class=Json)


@router.get("/schema", responses=errors())
async def schema() -> Json:
    """JSON schema of a problem file, for editors."""
    return Json(problem_schema())


@router.post("/problems/validate", response_model=CheckAnswer, responses=errors(404, 413, 503))
async def validate(given: ProblemInput, service: Service) -> Json:
    """Everything that is wrong with a problem; nothing is stored."""
    try:
        about = await service.requests.check(given)
    except Refusal as refusal:
        if refusal.status == 422 and refusal.issues:
            return Json({"valid": False, "issues": refusal.issues, "hash": None, "name": None, "robot": None})
        raise
    return Json({"valid": True, "issues": [], **{key: about[key] for key in ("hash", "name", "robot")}})


@router.post("/problems", status_code=201, response_model=ProblemAnswer, responses=errors(404, 413, 503, 507))
async def store(given: ProblemInput, service: Service) -> Json:
    """Store a problem; its hash stands for it as `problem` of a submission, with `start` and `goal` in their place."""
    about = await service.requests.check(given)
    request = await service.requests.of(given)

    def keep() -> None:
        service.archive.contents.check_room()
        kept = {key: request[key] for key in ("problem", "name", "start", "goal")}
        text = service.archive.contents.put(json.dumps(kept).encode())
        service.archive.problems.add(about["hash"], about["name"], about["robot"], text)

    await service.archive.write(keep)
    row = await service.archive.read(lambda: service.archive.problems.get(about["hash"]))
    if row is None:  # deleted meanwhile
        raise not_found("problem", about["hash"])
    return Json(_answer(row), 201)


@router.get("/problems", response_model=list[ProblemAnswer], responses=errors())
async def listed(archive: Kept, limit: Annotated[int, Query(ge=1, le=500)] = 100) -> Json:
    """The stored problems, the last stored first."""
    return Json([_answer(row) for row in await archive.read(lambda: archive.problems.newest(limit))])


@router.get("/problems/{hash}", responses=errors(404))
async def one(hash: HashPath, archive: Kept) -> Json:
    """A stored problem: text as it came, or JSON, with the `start`, `goal` or `name` that it was stored with in it."""
    row = await archive.read(lambda: archive.problems.get(hash))
    content = None if row is None else await archive.read(lambda: archive.contents.get(row["text"]))
    if content is None:
        raise not_found("problem", hash)
    stored = json.loads(content)
    return Json({**stored, "problem": await archive.read(lambda: problem_of(stored)), "start": None, "goal": None})


@router.delete("/problems/{hash}", status_code=204, responses=errors(404))
async def delete(hash: HashPath, archive: Kept) -> Response:
    """Forget a stored problem; its runs stay."""
    if not await archive.write(lambda: archive.problems.delete(hash)):
        raise not_found("problem", hash)
    return Response(status_code=204)


def _answer(row: dict[str, Any]) -> dict[str, Any]:
    return {key: row[key] for key in ProblemAnswer.model_fields}
