"""An MJCF file as MuJoCo compiles it: defaults, includes, frames and replicas are resolved by MuJoCo itself."""

import re
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

from optiplan.errors import InputError, Issue, OptiPlanError
from optiplan.files import is_file


class Compiled(NamedTuple):
    """MuJoCo's module and model, and remarks on files that are missing."""

    mujoco: Any
    model: Any
    notes: tuple[str, ...]


def compile_mjcf(path: Path) -> Compiled:
    """Compile an MJCF file; a mesh that is missing and only seen is left out with a remark.

    Raises:
        OptiPlanError: the package `mujoco` is not installed.
        InputError: no MJCF, or one that MuJoCo does not compile, with its line where MuJoCo tells it.
    """
    if find_spec("mujoco") is None:
        raise OptiPlanError(f"{path.name} is MJCF, which needs the package mujoco: pip install 'optiplan[sim]'")
    mujoco = import_module("mujoco")
    if not is_file(path):
        raise InputError([Issue(str(path), None, "mjcf", "no such file", "an MJCF file")])
    try:
        spec = mujoco.MjSpec.from_file(str(path))
        notes = _without_missing(spec, path)
        return Compiled(mujoco, spec.compile(), tuple(notes))
    except (ValueError, RuntimeError, TypeError) as error:
        text = " ".join(str(error).split())
        line = re.search(r"\bline (\d+)", text)
        where = None if line is None else int(line[1])
        raise InputError([Issue(str(path), where, "mjcf", text, "an MJCF that MuJoCo compiles")]) from error


def _without_missing(spec: Any, path: Path) -> list[str]:
    """Take textures out, which nothing here shows, and visual geoms whose mesh is no file.

    Raises:
        InputError: a mesh that bodies touch with is missing.
    """
    for material in spec.materials:
        material.textures = [""] * len(material.textures)
    for texture in list(spec.textures):
        spec.delete(texture)
    spec.compiler.discardvisual = False
    spec.compiler.fusestatic = False
    folder = Path(spec.modelfiledir or path.parent) / spec.meshdir
    missing = {mesh.name: mesh for mesh in spec.meshes if mesh.file and not _found(mesh.file, folder, path)}
    users = [geom for geom in spec.geoms if geom.meshname in missing]
    for geom in users:
        kind = "collision mesh" if geom.contype or geom.conaffinity else "mesh" if _has_mass(geom) else ""
        if kind:
            purpose = "" if kind == "collision mesh" else " and its mass"
            named = f"the {kind} {missing[geom.meshname].file} of body {geom.parent.name}{purpose}"
            raise InputError([Issue(str(path), None, "mjcf", f"{named}, which is missing in {folder}", "a mesh file")])
    for geom in users:
        spec.delete(geom)
    for mesh in missing.values():
        spec.delete(mesh)
    return [f"left out, not shown: the visual mesh {mesh.file}, which is missing" for mesh in missing.values()]


def _has_mass(geom: Any) -> bool:
    """Whether a geom gives its body a part of its mass, since the body states none."""
    massless = geom.mass == 0.0 or (geom.mass != geom.mass and geom.density == 0.0)  # NaN: not stated
    return not geom.parent.explicitinertial and not massless


def _found(file: str, folder: Path, path: Path) -> bool:
    return is_file(folder / file) or is_file(path.parent / file)
