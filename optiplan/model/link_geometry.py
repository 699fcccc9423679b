"""What is checked for each link: its mesh, the mesh's hull, or convex pieces."""

from collections.abc import Mapping

import coal
import numpy as np
import pinocchio as pin

from optiplan.model.convex import hull_of, vertices_of
from optiplan.model.robot_spec import CollisionSpec, Treatment

PRIMITIVE = "primitive"


def treatments(collision: Treatment | CollisionSpec) -> tuple[str, Mapping[str, str]]:
    """The default treatment, and that of the links which are named."""
    if isinstance(collision, str):
        return collision, {}
    named = {link: kind for kind in ("hull", "mesh", "convex_pieces") for link in getattr(collision, kind)}
    return collision.default, named


def treat(model: pin.Model, geometry: pin.GeometryModel, collision: Treatment | CollisionSpec) -> dict[str, str]:
    """Replace the meshes in `geometry` by what the robot.yaml asks for; returns what each link became."""
    default, named = treatments(collision)
    done: dict[str, str] = {}
    for item in geometry.geometryObjects:
        link = model.frames[item.parentFrame].name
        if not isinstance(item.geometry, coal.BVHModelBase):
            done.setdefault(link, PRIMITIVE)
            continue
        kind = named.get(link, default)
        if kind != "mesh":
            item.geometry = hull_of(vertices_of(item.geometry) * item.meshScale)
            item.meshScale = np.ones(3)
        done[link] = kind
    return done
