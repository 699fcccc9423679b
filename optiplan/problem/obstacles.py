"""Obstacles of a scene, for construction in Python: `Box("shelf", size=…, position=…)` and its like."""

from pathlib import Path
from typing import Any

from optiplan.errors import path_argument, wrong_argument
from optiplan.geometry.file_shapes import FileShape
from optiplan.geometry.meshes.reading import FORMATS, OCTREE_FORMATS, POINT_FORMATS
from optiplan.geometry.pose import Values, checked
from optiplan.geometry.scene import Obstacle
from optiplan.geometry.shapes import build_geometry, shape_from_spec
from optiplan.problem.builder import stated_pose
from optiplan.problem.schema.scene import ObstacleSpec


def Box(
    name: str,
    size: Values,
    position: Values = (0, 0, 0),
    rpy: Values | None = None,
    quaternion: Values | None = None,
    rpy_deg: Values | None = None,
) -> Obstacle:
    """A cuboid centred on its frame.

    Args:
        name: of its own, other than those of the links.
        size: edge lengths [x, y, z], m.
        position: of the centre in the world [x, y, z], m.
        rpy: [roll, pitch, yaw] about the fixed axes x, then y, then z of the world, rad.
        quaternion: [x, y, z, w] of unit length, instead of `rpy`.
        rpy_deg: `rpy` in degrees.

    Raises:
        InputError: an argument that does not fit.

    Example:
        >>> import optiplan as op
        >>> op.Box("shelf", size=(0.8, 0.3, 0.02), position=(0.5, 0, 0.4))
        Obstacle: shelf, Box(size=(0.8, 0.3, 0.02)), at [0.5, 0, 0.4] m
    """
    at = {"position": position, "rpy": rpy, "quaternion": quaternion, "rpy_deg": rpy_deg}
    return _obstacle("Box", name, {"box": size}, at, "size")


def Sphere(name: str, radius: float, position: Values = (0, 0, 0)) -> Obstacle:
    """A ball of a radius, m, around `position`, m; see `Box`."""
    return _obstacle("Sphere", name, {"sphere": radius}, {"position": position}, "radius")


def Cylinder(
    name: str,
    radius: float,
    length: float,
    position: Values = (0, 0, 0),
    rpy: Values | None = None,
    quaternion: Values | None = None,
    rpy_deg: Values | None = None,
) -> Obstacle:
    """A cylinder along its axis z, centred on its frame: its radius and whole length, m; the rest is as of `Box`."""
    at = {"position": position, "rpy": rpy, "quaternion": quaternion, "rpy_deg": rpy_deg}
    return _obstacle("Cylinder", name, {"cylinder": {"radius": radius, "length": length}}, at)


def Capsule(
    name: str,
    radius: float,
    length: float,
    position: Values = (0, 0, 0),
    rpy: Values | None = None,
    quaternion: Values | None = None,
    rpy_deg: Values | None = None,
) -> Obstacle:
    """A cylinder with round caps along its axis z, centred on its frame; the rest is as of `Box`.

    `length`, m, is that of the cylinder without the caps; `radius`, m, is that of both.
    """
    at = {"position": position, "rpy": rpy, "quaternion": quaternion, "rpy_deg": rpy_deg}
    return _obstacle("Capsule", name, {"capsule": {"radius": radius, "length": length}}, at)


def HalfSpace(name: str, normal: Values = (0, 0, 1), offset: float = 0.0) -> Obstacle:
    """All points p of the world with normal · p <= offset, m, such as a floor.

    The normal points out of the solid and has unit length.
    """
    return _obstacle("HalfSpace", name, {"half_space": {"normal": normal, "offset": offset}}, {})


def Mesh(  # noqa: PLR0913
    name: str,
    file: Path | str,
    scale: float | Values = 1.0,
    convex: bool = False,
    position: Values = (0, 0, 0),
    rpy: Values | None = None,
    quaternion: Values | None = None,
    rpy_deg: Values | None = None,
) -> Obstacle:
    """The triangles of a file; its pose, that of the file's origin, is as of `Box`.

    The file is STL, OBJ, DAE, PLY or GLB, relative to the working directory. Its numbers are multiplied by `scale`, one
    or [x, y, z]: 0.001 for millimetres. `convex` takes the convex hull instead, which is quicker.

    Raises:
        InputError: the file is missing or no mesh, or another argument does not fit.
    """
    path = path_argument("Mesh", "file", file, f"the path of a mesh file ({FORMATS})")
    at = {"position": position, "rpy": rpy, "quaternion": quaternion, "rpy_deg": rpy_deg}
    return _obstacle("Mesh", name, {"mesh": {"file": str(path.resolve()), "scale": scale, "convex": convex}}, at)


def PointCloud(
    name: str,
    file: Path | str,
    radius: float,
    position: Values = (0, 0, 0),
    rpy: Values | None = None,
    quaternion: Values | None = None,
    rpy_deg: Values | None = None,
) -> Obstacle:
    """Everything within `radius`, m, of the points of a file; its pose, that of the file's origin, is as of `Box`.

    The file is PLY (its vertices), PCD or NPZ (array `points`, (N, 3)), in m, relative to the working directory. The
    points are gathered in cells with edges of `radius`; the box around the balls of each cell is what is kept away
    from. Where nothing was seen counts as free.

    Raises:
        InputError: the file is missing or holds no points, or another argument does not fit.
    """
    path = path_argument("PointCloud", "file", file, f"the path of a point cloud file ({POINT_FORMATS})")
    at = {"position": position, "rpy": rpy, "quaternion": quaternion, "rpy_deg": rpy_deg}
    return _obstacle("PointCloud", name, {"points": {"file": str(path.resolve()), "radius": radius}}, at)


def Octree(
    name: str,
    file: Path | str,
    position: Values = (0, 0, 0),
    rpy: Values | None = None,
    quaternion: Values | None = None,
    rpy_deg: Values | None = None,
) -> Obstacle:
    """The occupied cells of an OctoMap file; its pose, that of the file's origin, is as of `Box`.

    The file is BT or OT, relative to the working directory. Cells that it does not know count as free.

    Raises:
        InputError: the file is missing or holds no occupied cell, or another argument does not fit.
    """
    path = path_argument("Octree", "file", file, f"the path of an octree file ({OCTREE_FORMATS})")
    at = {"position": position, "rpy": rpy, "quaternion": quaternion, "rpy_deg": rpy_deg}
    return _obstacle("Octree", name, {"octree": {"file": str(path.resolve())}}, at)


def _obstacle(function: str, name: str, shape: dict[str, Any], at: dict[str, Any], only: str | None = None) -> Obstacle:
    """Check and build; `only` names the argument of a shape that has just one."""
    ((kind, stated),) = shape.items()
    names = {f"shape.{kind}": only} if only else {f"shape.{kind}.{key}": key for key in stated}
    arguments = {**names, **{f"pose.{key}": key for key in at}, "pose": "rpy"}
    pose = {key: value for key, value in at.items() if value is not None}
    spec = checked(ObstacleSpec, {"name": name, "shape": shape, "pose": pose}, function, arguments)
    X_WO, words = stated_pose(spec.pose)
    solid = shape_from_spec(spec.shape)
    if isinstance(solid, FileShape):
        try:
            build_geometry(solid)
        except ValueError as error:
            missing = isinstance(error.__cause__, FileNotFoundError)
            found = f"{str(solid.file)!r}, which is not there" if missing else str(error)
            raise wrong_argument(function, "file", found, solid.wanted) from None
    return Obstacle(spec.name, solid, X_WO, words)
