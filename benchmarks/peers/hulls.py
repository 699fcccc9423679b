"""Robot and scene for peers that use Pinocchio and Coal: links as convex hulls, as our verifier has them."""

import coal
import numpy as np
import pinocchio as pin
from common import locked_urdf, refuse


def geometry(asked):
    """The robot, its links as hulls, in its scene, and the pairs that are checked."""
    urdf = locked_urdf(asked)
    model = pin.buildModelFromXML(urdf)
    shapes = pin.buildGeomFromUrdfString(model, urdf, pin.GeometryType.COLLISION)
    for item in shapes.geometryObjects:
        if isinstance(item.geometry, coal.BVHModelBase):
            item.geometry.buildConvexHull(True, "Qt")
            item.geometry = item.geometry.convex
    links = list(range(shapes.ngeoms))
    names = [model.frames[item.parentFrame].name for item in shapes.geometryObjects]
    allowed = {frozenset(pair) for pair in asked["allowed"]}
    for i in links:
        for j in links[i + 1 :]:
            if names[i] != names[j] and frozenset((names[i], names[j])) not in allowed:
                shapes.addCollisionPair(pin.CollisionPair(i, j))
    for body in asked["obstacles"]:
        index = shapes.addGeometryObject(obstacle(body))
        for i in links:
            shapes.addCollisionPair(pin.CollisionPair(i, index))
    return model, shapes


def obstacle(body):
    """A body of the scene."""
    ((kind, value),) = body["shape"].items()
    if kind == "box":
        shape = coal.Box(*value)
    elif kind == "sphere":
        shape = coal.Sphere(value)
    elif kind == "cylinder":
        shape = coal.Cylinder(value["radius"], value["length"])
    elif kind == "mesh":
        shape = coal.MeshLoader().load(value["file"], np.array(value.get("scale", [1, 1, 1]), float))
    else:
        refuse(f"a body of kind {kind}")
    pose = np.array(body["pose"])
    return pin.GeometryObject(body["name"], 0, 0, pin.SE3(pose[:3, :3], pose[:3, 3]), shape)
