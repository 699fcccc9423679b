"""Routes of runs: submit, look, cancel, delete, and the files of a run."""

import json
import tempfile
import uuid
from pathlib import Path
from typing import Annotated

from fastapi import APIRouter, Query, Request
from fastapi.responses import Response
from starlette.background import BackgroundTask

from optiplan.runs.export import FORMATS, export_trajectory
from optiplan.runs.run_folder import RUN, TRAJECTORY
from optiplan.service.archive import Archive
from optiplan.service.models import PlanAnswer, PlanRequest, QueuedSubmission, RunAnswer, RunId, RunList, SubmittedRun
from optiplan.service.refusals import Refusal, not_found
from optiplan.service.routes.answers import (
    Json,
    Kept,
    RunPath,
    Service,
    errors,
    files,
    problem_of,
    run_answer,
    run_answers,
    zipped,
)
from optiplan.service.store.run_table import ENDED
from optiplan.trajectory.trajectory import Trajectory

router = APIRouter(prefix="/api", default_response_class=Json)

MEDIA = {"csv": "text/csv", "json": "application/json", "ros": "application/yaml", "urscript": "text/plain"}
BYTES = "application/octet-stream"


@router.post("/runs", status_code=202, response_model=SubmittedRun, responses=errors(404, 413, 503, 507))
async def submit(submission: QueuedSubmission, service: Service) -> Json:
    """Queue a run. The same submission is the same run: its id again, with the answer where there is one."""
    name = submission.submission or uuid.uuid4().hex
    return Json(run_answer(await service.queued.submit(submission, name)) | {"submission": name}, 202)


@router.get("/runs", response_model=RunList, responses=errors())
async def listed(
    archive: Kept,
    limit: Annotated[int, Query(ge=1, le=500)] = 50,
    before: Annotated[float | None, Query(allow_inf_nan=False, description="Submitted before this time")] = None,
) -> Json:
    """The runs, the last submitted first."""
    records = await archive.read(lambda: archive.runs.newest(limit, before))
    return Json({"runs": run_answers(records), "counts": await archive.read(archive.runs.counts)})


@router.get("/runs/{run}", response_model=RunAnswer, responses=errors(404))
async def one(run: RunPath, archive: Kept) -> Json:
    """A run."""
    return Json(run_answer(await archive.run(run)))


@router.delete("/runs/{run}", status_code=204, responses=errors(404, 409))
async def delete(run: RunPath, service: Service) -> Response:
    """Forget a run that has ended, with its files."""
    record = await service.archive.run(run)
    if record["status"] not in ENDED:
        raise Refusal(409, f"the run is {record['status']}; cancel it first")
    await service.archive.write(lambda: service.queued.forget(run))
    return Response(status_code=204)


@router.post("/runs/{run}/cancel", response_model=RunAnswer, responses=errors(404, 409))
async def cancel(
    run: RunPath,
    service: Service,
    submission: Annotated[RunId | None, Query(description="The one to take back, as its answer names it")] = None,
    everyone: Annotated[bool, Query(description="Cancel the run whoever submitted it")] = False,
) -> Json:
    """Cancel a run: at once where it waits, within a second where it runs; one that has ended stays as it is.

    A run that was submitted several times ends once all submissions are taken back.
    """
    await service.archive.run(run)
    left = await service.archive.write(lambda: service.queue.cancel(run, submission, everyone))
    if left and submission is None:
        words = "?submission=… with the `submission` of yours, or ?everyone=true"
        raise Refusal(409, f"the run was submitted {left} times, by others too; expected {words}")
    return Json(run_answer(await service.archive.run(run)))


@router.get("/runs/{run}/trajectory.json", responses=errors(404))
async def trajectory(run: RunPath, archive: Kept) -> Response:
    """The motion: `joint_names`, `pieces`, and samples `t`, `q`, `v`, `a`."""
    return await _file(archive, run, TRAJECTORY)


@router.get("/runs/{run}/run.json", responses=errors(404))
async def record(run: RunPath, archive: Kept) -> Response:
    """Everything about the run but its motion: the problem, the report, measures, timings."""
    return await _file(archive, run, RUN)


@router.get("/runs/{run}/problem", response_class=Response, responses=files("application/yaml") | errors(404))
async def problem(run: RunPath, archive: Kept) -> Response:
    """The problem of the run: the text as it was submitted, or its data as JSON, which is YAML too.

    A `start`, `goal` or `name` that was submitted beside the problem is in the data.
    """
    stored = await archive.stored_request(await archive.run(run))
    given = await archive.read(lambda: problem_of(stored))
    return Response(
        given if isinstance(given, str) else json.dumps(given, indent=2), media_type="application/yaml; charset=utf-8"
    )


@router.get("/runs/{run}/scene", responses=errors(404, 503))
async def scene(run: RunPath, service: Service) -> Response:
    """What a page draws of a run: the scene and the motion."""
    record = await service.archive.run(run)
    asked = await service.archive.motion_request(record) | {"hash": record["problem"]}
    answer = await service.requests.ask(asked, "scene")
    return Response(answer.files["scene.json"], media_type="application/json")


@router.get("/runs/{run}/run.zip", response_class=Response, responses=files("application/zip") | errors(404))
async def folder(run: RunPath, archive: Kept) -> Response:
    """The run folder, as `optiplan verify` and `optiplan view` read it."""
    found = await archive.run(run)
    return zipped({name: await archive.content(found, name) for name in found["contents"] or {RUN: ""}})


@router.get(
    "/runs/{run}/export.{format}", response_class=Response, responses=files(*MEDIA.values(), BYTES) | errors(404)
)
async def exported(
    run: RunPath,
    format: str,
    service: Service,
    rate: Annotated[float | None, Query(gt=0, le=10_000, description="Samples a second")] = None,
    unverified: Annotated[bool, Query(description="Write a motion that is not verified, too")] = False,
) -> Response:
    """The motion for other programs: csv, json, npz, ros or urscript."""
    if format not in FORMATS:
        raise Refusal(404, f"there is no format '{format}'; choose from: {', '.join(FORMATS)}")
    archive = service.archive
    record = await archive.run(run)
    content = await archive.content(record, TRAJECTORY)
    if not (record["verified"] or unverified):
        raise Refusal(422, "the motion of this run is not verified; ?unverified=true writes it all the same")

    if FORMATS[format].cyclic and not unverified:  # slowed down to end on a cycle, and proved again, by a solver
        asked = await archive.motion_request(record) | {"format": format, "rate": rate}
        written = (await service.requests.ask(asked, "export")).files[format]
        return Response(written, media_type=MEDIA.get(format, BYTES))

    def made() -> bytes:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / f"motion{FORMATS[format].suffixes[0]}"
            export_trajectory(Trajectory.from_dict(json.loads(content)), path, format, rate)
            return path.read_bytes()

    return Response(await archive.read(made), media_type=MEDIA.get(format, BYTES))


@router.post("/plan", response_model=PlanAnswer, responses=errors(404, 413, 503, 504, 507))
async def plan(submission: PlanRequest, service: Service, request: Request) -> Response:
    """Plan and wait for the answer, past the queue: for callers that need the motion now. Who goes away, cancels.

    Each request is planned and has an id of its own, under which the motion that was answered is kept.
    """
    run = await service.waited.plan(submission, request.is_disconnected)
    head = json.dumps(run_answer(run.record), allow_nan=False, separators=(",", ":"))
    motion = b"null" if run.motion is None else run.motion.rstrip()
    body = head[:-1].encode() + b',"trajectory":' + motion + b"}"
    return Response(body, media_type="application/json", background=BackgroundTask(run.keep))


async def _file(archive: Archive, run: str, name: str) -> Response:
    found = await archive.run(run)
    if name == TRAJECTORY and found["status"] == "failed":
        raise not_found("trajectory of the failed run", run)
    return Response(await archive.content(found, name), media_type="application/json")
