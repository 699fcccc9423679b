"""Masses of bodies: what MassAPI states, and what its colliders weigh where it states nothing.

    mass of a collider = its own mass, else density × volume, with the density of the collider, of the body, of its
    physics material, else 1000 kg/m³

A stated mass without a stated inertia takes that of the colliders, scaled to the mass; a part of the inertia, centre or
axes that is stated replaces theirs. Source: the schema UsdPhysics.MassAPI.
"""

from collections.abc import Sequence
from importlib import import_module
from typing import Any

import numpy as np
import pinocchio as pin
import trimesh

from optiplan.arrays import Array
from optiplan.geometry.mass_properties import primitive_inertia
from optiplan.importers.robots.usd.shapes import UsdShape
from optiplan.importers.robots.usd.stage import Affine, UsdStage, schemas

WATER = 1000.0
"""kg/m³, where no density is stated."""

MASS = "PhysicsMassAPI"


def body_inertia(
    stage: UsdStage, body: Any, X_WL: pin.SE3, solids: Sequence[tuple[Any, UsdShape]]
) -> pin.Inertia | None:
    """The inertia of a body in its frame L, kg, m, kg·m²; None where nothing has a mass.

    Args:
        stage: that of the body.
        body: a rigid body.
        X_WL: where it is.
        solids: its colliders and their shapes in L.

    Raises:
        InputError: a mass, a density, a centre or an inertia that is none.
    """
    stated = _stated(stage, body, "physics:mass") * stage.kilograms
    total = _of_colliders(stage, body, solids)
    if stated > 0.0:
        if total is not None and total.mass > 0.0:
            total = pin.Inertia(stated, total.lever, total.inertia * (stated / total.mass))
        else:
            total = pin.Inertia(stated, np.zeros(3), np.zeros((3, 3)))
    return None if total is None else _with_stated(stage, body, X_WL, total)


def _stated(stage: UsdStage, prim: Any, name: str) -> float:
    """A mass or density in the units of the stage; 0 where none is stated."""
    value = stage.number(prim, name, 0.0) if MASS in schemas(prim) or name == "physics:density" else 0.0
    if not 0.0 <= value < np.inf:
        raise stage.issue(prim, repr(value), "a number >= 0", name)
    return value


def _of_colliders(stage: UsdStage, body: Any, solids: Sequence[tuple[Any, UsdShape]]) -> pin.Inertia | None:
    total: pin.Inertia | None = None
    unit = stage.kilograms / stage.metres**3
    own = _stated(stage, body, "physics:density") * unit
    for prim, shape in solids:
        filled = filled_with_one(shape)
        mass = _stated(stage, prim, "physics:mass") * stage.kilograms
        density = _stated(stage, prim, "physics:density") * unit or own or _of_material(stage, prim) * unit or WATER
        mass = mass or density * filled.mass
        if filled.mass <= 0.0:
            continue
        part = pin.Inertia(mass, filled.lever, filled.inertia * (mass / filled.mass))
        total = part if total is None else total + part
    return total


def _of_material(stage: UsdStage, prim: Any) -> float:
    """The density of the physics material that is bound to a collider; 0 without one."""
    shade: Any = import_module("pxr.UsdShade")
    material = shade.MaterialBindingAPI(prim).ComputeBoundMaterial("physics")[0]
    return _stated(stage, material.GetPrim(), "physics:density") if material else 0.0


def filled_with_one(shape: UsdShape) -> pin.Inertia:
    """The inertia of a shape of 1 kg/m³ in its L: its mass is its volume, m³; a mesh counts as its hull."""
    if shape.kind in ("box", "sphere", "cylinder", "capsule"):
        return shape.X.act(primitive_inertia(shape.kind, shape.sizes))
    if shape.kind == "plane":
        return pin.Inertia.Zero()
    try:
        hull = trimesh.Trimesh(shape.vertices, shape.triangles, process=False).convex_hull
    except (ValueError, RuntimeError):  # QhullError is one: the mesh is flat
        return pin.Inertia.Zero()
    return pin.Inertia(float(hull.volume), np.array(hull.center_mass), np.array(hull.moment_inertia))


def _with_stated(stage: UsdStage, body: Any, X_WL: pin.SE3, total: pin.Inertia) -> pin.Inertia:
    """The inertia with the centre of mass, the moments and the axes that the body states."""
    if MASS not in schemas(body):
        return total
    A_LB = stage.placed(body).seen_from(X_WL)
    centre = _vector(stage, body, "physics:centerOfMass", -np.inf)
    lever = total.lever if not np.isfinite(centre).all() else Affine(A_LB.A, A_LB.t).points(centre[None])[0]
    moments = _vector(stage, body, "physics:diagonalInertia", 0.0)
    if (moments < 0.0).any():
        raise stage.issue(body, str(moments), "three numbers >= 0", "physics:diagonalInertia")
    if not moments.any():
        return pin.Inertia(total.mass, lever, total.inertia)
    axes = stage.value(body, "physics:principalAxes")
    w, xyz = (1.0, (0.0, 0.0, 0.0)) if axes is None else (float(axes.GetReal()), axes.GetImaginary())
    turn = pin.Quaternion(w, *(float(x) for x in xyz))
    R = turn.normalized().toRotationMatrix() if turn.norm() > 0.0 else np.eye(3)
    unit = stage.kilograms * stage.metres**2
    return pin.Inertia(total.mass, lever, R @ np.diag(moments * unit) @ R.T)


def _vector(stage: UsdStage, prim: Any, name: str, default: float) -> Array:
    value = stage.value(prim, name)
    vector = np.full(3, default) if value is None else np.array(value, float)
    if np.isnan(vector).any():
        raise stage.issue(prim, str(vector), "three numbers", name)
    return vector
