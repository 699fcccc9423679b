"""Routes of uploaded files: meshes, URDF, SRDF and robot.yaml, which problems name by their paths."""

import re
from typing import Annotated

from fastapi import APIRouter, Body, Path
from fastapi.responses import Response

from optiplan.service.models import UploadList
from optiplan.service.refusals import Refusal, not_found
from optiplan.service.routes.answers import Json, Kept, errors

router = APIRouter(prefix="/api/uploads", default_response_class=Json)

PART = re.compile(r"[A-Za-z0-9_-][A-Za-z0-9._-]{0,99}")
"""A folder or file of an upload: no hidden ones, nothing that leads upwards."""
DEEPEST = 8
"""Folders within folders."""

UploadPath = Annotated[str, Path(description="Where problems find it: mesh and robot files by this name")]


@router.get("", response_model=UploadList, responses=errors())
async def listed(archive: Kept) -> Json:
    """All uploads by path, with their bytes and when each was uploaded or used last."""
    found = await archive.read(archive.uploads.all)
    return Json({"uploads": [vars(upload) for upload in found], "bytes": sum(upload.bytes for upload in found)})


@router.put("/{path:path}", status_code=201, responses=errors(413, 507))
async def upload(
    path: UploadPath, content: Annotated[bytes, Body(media_type="application/octet-stream")], archive: Kept
) -> Json:
    """Upload a mesh, URDF, SRDF or robot.yaml, which problems then name by this path; an older one is replaced."""
    _check(path)

    def keep() -> None:
        archive.contents.check_room()
        try:
            archive.uploads.put(path, content)
        except (FileExistsError, NotADirectoryError, IsADirectoryError):
            raise Refusal(422, f"path: '{path}' is a folder, or below a file") from None

    await archive.write(keep)
    return Json({"file": path, "bytes": len(content)}, 201)


@router.delete("/{path:path}", status_code=204, responses=errors(404))
async def delete(path: UploadPath, archive: Kept) -> Response:
    """Delete an upload; problems that name it cannot be planned any more."""
    _check(path)
    if not await archive.write(lambda: archive.uploads.delete(path)):
        raise not_found("upload", path)
    return Response(status_code=204)


def _check(path: str) -> None:
    parts = path.split("/")
    if len(parts) > DEEPEST or not all(PART.fullmatch(part) for part in parts):
        raise Refusal(422, f"path: found {path[:80]!r}; expected names of letters, digits, '.', '_', '-' between '/'")
