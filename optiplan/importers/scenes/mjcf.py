"""The bodies of an MJCF file that stand still or lie loose, as obstacles; bodies with other joints are robots.

A file of which no such geom can touch is a picture: all that are drawn are taken.
"""

from pathlib import Path
from typing import Any

import pinocchio as pin

from optiplan.config.messages import some
from optiplan.importers.robots.mjcf.compiled import compile_mjcf
from optiplan.importers.robots.mjcf.geoms import SEEN, carried_bodies, mesh_of, touches
from optiplan.importers.robots.polyhedra import ellipsoid_hull
from optiplan.importers.scenes.imported import ImportedScene


def read_mjcf_scene(path: Path) -> ImportedScene:
    """Read the bodies of an MJCF file as its first keyframe has them, else at its reference positions.

    Raises:
        InputError: no MJCF, or one that MuJoCo does not compile.
        OptiPlanError: the package `mujoco` is not installed.
    """
    mujoco, model, remarks = compile_mjcf(path)
    scene = ImportedScene(path, notes=list(remarks))
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_kinematics(model, data)
    robots = carried_bodies(mujoco, model)
    for geom in _solid(model, robots, scene):
        name = _name(model, geom)
        X_WG = pin.SE3(data.geom_xmat[geom].reshape(3, 3).copy(), data.geom_xpos[geom].copy())
        if int(model.geom_type[geom]) == mujoco.mjtGeom.mjGEOM_PLANE:
            scene.add_half_space(name, X_WG)
        elif (shape := _shape(mujoco.mjtGeom, model, geom, name, scene)) is not None:
            scene.add(name, shape, X_WG)
        else:
            scene.notes.append(f"left out: {name}, a height field or signed distance field")
    left_out = [str(model.body(b).name) for b in sorted(robots) if int(model.body_parentid[b]) not in robots]
    loose = [str(model.body(b).name) for b in range(model.nbody) if model.body_jntnum[b] and b not in robots]
    scene.note_bodies(left_out, loose)
    if model.nkey and loose:
        scene.notes.append(f"loose bodies stand as in the keyframe {model.key(0).name or 'number 0'}")
    return scene


def _solid(model: Any, robots: set[int], scene: ImportedScene) -> list[int]:
    """The geoms of no robot that can touch; without any, those that are drawn."""
    geoms = [geom for geom in range(model.ngeom) if int(model.geom_bodyid[geom]) not in robots]
    solid = [geom for geom in geoms if touches(model, geom)]
    if not solid and (drawn := [geom for geom in geoms if model.geom_group[geom] < SEEN]):
        scene.notes.append("no geom outside of robots can touch another: all that the file shows are obstacles")
        return drawn
    if ghosts := [_name(model, geom) for geom in geoms if geom not in solid]:
        scene.notes.append(f"left out, since they cannot touch: geoms of {some(list(dict.fromkeys(ghosts)), 6)}")
    return solid


def _name(model: Any, geom: int) -> str:
    return str(model.geom(geom).name or model.body(int(model.geom_bodyid[geom])).name or "body")


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
