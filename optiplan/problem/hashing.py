"""Identity of a problem: its source as plain data, and the hash of its content, wherever its files are."""

import copy
import hashlib
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from optiplan.files import read_bytes
from optiplan.problem.schema.ends import RATES
from optiplan.problem.schema.joint_names import ends_of
from optiplan.problem.schema.scene import MotionSpec
from optiplan.robot.robot import Robot, robot_names

if TYPE_CHECKING:
    from optiplan.problem.schema.problem import ProblemSpec


def source_of(spec: "ProblemSpec", name: str, base: Path, robot: Robot) -> tuple[dict[str, Any], str]:
    """`Problem.source` and `Problem.hash`: the file's content with absolute paths, and its identity.

    Args:
        spec: the validated file.
        name: of the problem, when the file gives none.
        base: folder that meshes are relative to.
        robot: as loaded for the problem.
    """
    source = spec.model_dump(mode="json", exclude_none=True, by_alias=True)
    source["name"] = spec.name or name
    _say_in_one_way(source)
    for step in source.get("task", ()):
        if "tour" in step:
            from optiplan.problem.task.target_files import targets_data

            step["tour"]["targets"] = targets_data(step["tour"]["targets"], base)
        if "path" in step:
            from optiplan.problem.seams.reading import with_points

            step["path"] = with_points(step["path"], base)
    digest = problem_hash(source, base, robot)
    source["robot"] = _named(spec, robot)
    for mesh in shape_files_of(source):
        mesh["file"] = str((base / mesh["file"]).resolve())
    return source, digest


def _named(spec: "ProblemSpec", robot: Robot) -> Any:
    """Return `robot:` with absolute paths."""
    if isinstance(spec.robot, str):
        return spec.robot if spec.robot in robot_names() else str(robot.source)
    return robot.reference.robot


def problem_hash(data: Mapping[str, Any], base: Path, robot: Robot) -> str:
    """SHA-256, in hex, of a problem: its validated data, the bytes of its meshes and of its robot's files.

    Names and locations of files are ignored; only their contents count.

    Args:
        data: the validated file as plain data; numbers as Python writes them, keys sorted.
        base: folder that mesh files are relative to.
        robot: as loaded for the problem.
    """
    content = dict(data)
    if next(shape_files_of(data), None) is not None:
        content |= {key: copy.deepcopy(data[key]) for key in ("scene", "tools", "tool") if key in data}
    content["robot"] = robot.fingerprint
    content["locked"] = dict(robot.locked)
    for mesh in shape_files_of(content):
        mesh["file"] = _digest(base / mesh["file"])
    text = json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


def shape_files_of(data: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """Return the mappings with a `file` of all shapes in the data of a problem, to be read or changed in place."""
    scene, tools = data.get("scene", {}), [*data.get("tools", {}).values()]
    tools += [data["tool"]] if isinstance(data.get("tool"), dict) else []
    shapes = [one for tool in tools for one in tool.get("shapes", ())]
    for body in (*scene.get("obstacles", ()), *scene.get("attached", ()), *shapes):
        for stated in body["shape"].values():
            if isinstance(stated, dict) and "file" in stated:
                yield stated


def _say_in_one_way(data: dict[str, Any]) -> None:
    """Say once what may be said in several ways, in the data of a problem, which are changed in place.

    That is pairs in any order, polynomials with zeros at their end, and rest at an end: it has no rates.
    """
    scene = data["scene"]
    scene["allowed_collisions"] = sorted(sorted(pair) for pair in scene["allowed_collisions"])
    for body in scene["obstacles"]:
        if "motion" in body:
            body["motion"] = MotionSpec(**body["motion"]).about(body["pose"]["position"]).to_data()
    for place, end in ends_of(data, ("move",)):
        for key in RATES:
            if "via" not in place and key in end and not any(end[key]):
                del end[key]  # type: ignore[attr-defined]  # it is the data of a file, as dictionaries


def _digest(file: Path) -> str:
    return hashlib.sha256(read_bytes(file)).hexdigest()
