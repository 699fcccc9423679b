"""The bodies of an MJCF file that stand still or lie loose, as obstacles; bodies with other joints are robots."""

from pathlib import Path
from typing import Any

import pinocchio as pin

from optiplan.importers.robots.mjcf.compiled import compile_mjcf
from optiplan.importers.robots.mjcf.geoms import mesh_of, touches
from optiplan.importers.robots.polyhedra import ellipsoid_hull
from optiplan.importers.scenes.imported import ImportedScene


def read_mjcf_scene(path: Path) -> ImportedScene:
    """Read the bodies of an MJCF file at its reference positions.

    Raises:
        InputError: no MJCF, or one that MuJoCo does not compile.
        OptiPlanError: the package `mujoco` is not installed.
    """
    mujoco, model, remarks = compile_mjcf(path)
    scene = ImportedScene(path, notes=list(remarks))
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    free = int(mujoco.mjtJoint.mjJNT_FREE)
    jointed = {b for b in range(model.nbody) if any(int(model.jnt_type[j]) != free for j in _joints(model, b))}
    robots = {b for b in range(model.nbody) if _above(model, b) & jointed}
    for geom in (g for g in range(model.ngeom) if touches(model, g) and int(model.geom_bodyid[g]) not in robots):
        name = str(model.geom(geom).name or model.body(int(model.geom_bodyid[geom])).name or "body")
        X_WG = pin.SE3(data.geom_xmat[geom].reshape(3, 3).copy(), data.geom_xpos[geom].copy())
        if int(model.geom_type[geom]) == mujoco.mjtGeom.mjGEOM_PLANE:
            scene.add_half_space(name, X_WG)
        elif (shape := _shape(mujoco.mjtGeom, model, geom, name, scene)) is not None:
            scene.add(name, shape, X_WG)
        else:
            scene.notes.append(f"left out: {name}, a height field or signed distance field")
    left_out = [str(model.body(b).name) for b in sorted(robots) if int(model.body_parentid[b]) not in robots]
    loose = [str(model.body(b).name) for b in range(model.nbody) if len(_joints(model, b)) and b not in robots]
    scene.note_bodies(left_out, loose)
    return scene


def _shape(kinds: Any, model: Any, geom: int, name: str, scene: ImportedScene) -> dict[str, Any] | None:
    """The shape of a geom as data of a problem file; None of one that has no counterpart."""
    kind, (a, b, c) = int(model.geom_type[geom]), (float(x) for x in model.geom_size[geom])
    plain: dict[int, dict[str, Any]] = {
        int(kinds.mjGEOM_BOX): {"box": [2 * a, 2 * b, 2 * c]},
        int(kinds.mjGEOM_SPHERE): {"sphere": a},
        int(kinds.mjGEOM_CYLINDER): {"cylinder": {"radius": a, "length": 2 * b}},
        int(kinds.mjGEOM_CAPSULE): {"capsule": {"radius": a, "length": 2 * b}},
    }
    if kind in plain:
        return plain[kind]
    if kind == kinds.mjGEOM_ELLIPSOID:
        return _hull(scene.mesh(name, *ellipsoid_hull(a, b, c)))
    if kind == kinds.mjGEOM_MESH:
        return _hull(scene.mesh(name, *mesh_of(model, int(model.geom_dataid[geom]))))
    return None


def _hull(shape: dict[str, Any]) -> dict[str, Any]:
    """The convex hull of a mesh, as MuJoCo takes it."""
    return {"mesh": {**shape["mesh"], "convex": True}}


def _joints(model: Any, body: int) -> range:
    first = int(model.body_jntadr[body])
    return range(first, first + int(model.body_jntnum[body])) if first >= 0 else range(0)


def _above(model: Any, body: int) -> set[int]:
    """A body and those that carry it."""
    found = {body}
    while body > 0:
        body = int(model.body_parentid[body])
        found.add(body)
    return found
