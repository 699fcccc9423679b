"""The colliders of a USD stage that stand still or lie loose, as obstacles; bodies whose joints move are robots.

A stage without any collider is a picture: all shapes that it shows are taken.
"""

from pathlib import Path
from typing import Any

import pinocchio as pin

from optiplan.importers.robots.usd.joints import read_joints
from optiplan.importers.robots.usd.shapes import NOT_READ, SHAPES, UsdShape, gprims, shape_of
from optiplan.importers.robots.usd.stage import UsdStage, opened_stage
from optiplan.importers.robots.usd.tree import rigid_bodies, robots
from optiplan.importers.scenes.imported import ImportedScene


def read_usd_scene(path: Path) -> ImportedScene:
    """Read a USD stage, in metres with z up.

    Raises:
        InputError: no USD, or a collider that cannot be used, with its prim.
        OptiPlanError: the package `usd-core` is not installed.
    """
    scene = ImportedScene(path)
    with opened_stage(path) as stage:
        _read(stage, scene)
    return scene


def _read(stage: UsdStage, scene: ImportedScene) -> None:
    """Add what stands still or lies loose."""
    bodies = rigid_bodies(stage)
    places = {path: stage.placed(prim).pose() for path, prim in bodies.items()}
    moving = {body for group in robots(read_joints(stage, places), places) for body in group}
    shapes = [*gprims(stage, stage.stage.GetPseudoRoot())]
    for path_of, prim in bodies.items():
        shapes += gprims(stage, prim) if path_of not in moving else []
    solid = [prim for prim, collides in shapes if collides]
    if not solid:
        solid = [prim for prim, _ in shapes if stage.drawn(prim)]
        if solid:
            scene.notes.append("no collider in the stage: all shapes that it shows are obstacles")
    for prim in solid:
        _add(stage, prim, scene)
    scene.note_bodies(sorted(moving), sorted(bodies.keys() - moving))


def _add(stage: UsdStage, prim: Any, scene: ImportedScene) -> None:
    """Add one collider.

    Raises:
        InputError: a type of prim that has no counterpart.
    """
    shape = shape_of(stage, prim, pin.SE3.Identity(), collides=True)
    name = str(prim.GetName())
    if shape is None or str(prim.GetTypeName()) in NOT_READ:
        read = ", ".join(kind for kind in SHAPES if not kind.endswith("_1"))
        raise stage.issue(prim, f"a collider of type {prim.GetTypeName()}", f"one of: {read}")
    if shape.kind == "plane":
        scene.add_half_space(name, shape.X)
    else:
        scene.add(name, _data(name, shape, scene), shape.X)


def _data(name: str, shape: UsdShape, scene: ImportedScene) -> dict[str, Any]:
    """The shape as data of a problem file."""
    if shape.kind == "box":
        return {"box": list(shape.sizes)}
    if shape.kind == "sphere":
        return {"sphere": shape.sizes[0]}
    if shape.kind in ("cylinder", "capsule"):
        return {shape.kind: {"radius": shape.sizes[0], "length": shape.sizes[1]}}
    kept = scene.mesh(name, shape.vertices, shape.triangles)
    return {"mesh": {**kept["mesh"], "convex": True}} if shape.convex else kept
