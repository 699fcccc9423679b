"""Gprims of USD as shapes: sizes, scale and shear applied, in metres.

Cube, Sphere, Cylinder, Capsule    as they are, where their scale leaves them of that kind
Cone, and what its scale distorts  a polyhedron around it: 32 sides, 0.5 % wider at most; ellipsoids 3.2 %
Mesh                               its faces as triangles; what `physics:approximation` makes of it
Plane                              a half-space, of scenes only
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pinocchio as pin
from scipy.spatial import QhullError

from optiplan.arrays import Array
from optiplan.geometry.convex_hulls import plain_hull
from optiplan.geometry.meshes.box_surfaces import box_corners
from optiplan.geometry.meshes.triangles import Triangles
from optiplan.importers.robots.polyhedra import ellipsoid_hull, frustum_hull
from optiplan.importers.robots.usd.stage import Affine, UsdStage, schemas
from optiplan.records import dataclass

COLLISION, BODY = "PhysicsCollisionAPI", "PhysicsRigidBodyAPI"
SHAPES = ("Cube", "Sphere", "Cylinder", "Cylinder_1", "Capsule", "Capsule_1", "Cone", "Mesh", "Plane")
NOT_READ = ("Points", "BasisCurves", "NurbsCurves", "NurbsPatch", "HermiteCurves", "TetMesh", "PointInstancer")
"""Types of prims with an extent that are no shapes here."""

EVEN = 1e-4
"""Scales that differ by less, relatively, are the same; so are columns whose cosine is below."""

_TURNS = {
    "X": np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0]], float),
    "Y": np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0]], float),
    "Z": np.eye(3),
}
"""R: from a frame with the axis along z to that of the prim."""


@dataclass(frozen=True)
class UsdShape:
    """A shape in the frame L of a link or the world.

    Attributes:
        kind: box, sphere, cylinder, capsule, mesh or plane; axes are along z, a plane is solid below z = 0.
        sizes: m; of a box its edges, else radius and length.
        X: its pose in L; that of a mesh is L itself.
        vertices: of a mesh (k, 3), m.
        triangles: of a mesh (m, 3).
        convex: whether the mesh is its own hull.
    """

    kind: str
    sizes: tuple[float, ...]
    X: pin.SE3
    vertices: Array
    triangles: Triangles
    convex: bool = False


def is_body(stage: UsdStage, prim: Any) -> bool:
    """Whether a prim is a rigid body that is not turned off."""
    return BODY in schemas(prim) and bool(stage.value(prim, "physics:rigidBodyEnabled", True))


def gprims(stage: UsdStage, root: Any, solid: bool = False) -> Iterator[tuple[Any, bool]]:
    """The shapes at and below a prim, and whether each is a collider; bodies below are not entered.

    A collider has the collision API itself or on a prim between. Where it is turned off (`physics:collisionEnabled`)
    the shape is none.

    Args:
        stage: that of the prim.
        root: the prim.
        solid: whether a prim above makes everything below a collider.
    """
    own = solid
    if COLLISION in schemas(root):
        own = bool(stage.value(root, "physics:collisionEnabled", True))
    if str(root.GetTypeName()) in (*SHAPES, *NOT_READ):
        yield root, own
    for child in root.GetFilteredChildren(stage.usd.TraverseInstanceProxies()):
        if not is_body(stage, child):
            yield from gprims(stage, child, own)


def shape_of(stage: UsdStage, prim: Any, X_WL: pin.SE3, collides: bool) -> UsdShape | None:
    """The shape of a gprim in L; None of a type that has no counterpart.

    Raises:
        InputError: sizes or faces that are none, a shape of a type that is not read.
    """
    kind = str(prim.GetTypeName()).removesuffix("_1")
    A_LP = stage.placed(prim).seen_from(X_WL)
    if kind == "Mesh":
        return _mesh(stage, prim, A_LP, collides)
    if kind not in SHAPES:
        return None
    if kind == "Plane":
        return UsdShape("plane", (), _turned(stage, prim, A_LP).pose(), *_NOTHING)
    if kind == "Cube":
        return _box(A_LP, np.full(3, _size(stage, prim, "size", 2.0)))
    if kind == "Sphere":
        return _ball(A_LP, _size(stage, prim, "radius", 1.0))
    return _round(stage, prim, kind, _turned(stage, prim, A_LP))


_NOTHING = (np.zeros((0, 3)), np.zeros((0, 3), int))


def _size(stage: UsdStage, prim: Any, name: str, default: float, may_vanish: bool = False) -> float:
    value = stage.number(prim, name, default)
    if not 0.0 <= value < np.inf or (value == 0.0 and not may_vanish):
        raise stage.issue(prim, repr(value), f"a number {'>=' if may_vanish else '>'} 0", name)
    return value


def _turned(stage: UsdStage, prim: Any, A: Affine) -> Affine:
    """The map of a shape whose axis is along z."""
    axis = str(stage.value(prim, "axis", "Z"))
    if axis not in _TURNS:
        raise stage.issue(prim, f"'{axis}'", "X, Y or Z", "axis")
    return Affine(A.A @ _TURNS[axis], A.t)


def _scales(A: Affine) -> Array | None:
    """The lengths of the columns (3,); None where shear tilts them against each other."""
    scales = np.linalg.norm(A.A, axis=0)
    cosines = (A.A / scales).T @ (A.A / scales) - np.eye(3)
    return None if np.abs(cosines).max() > EVEN else scales


def _pose(A: Affine, scales: Array) -> pin.SE3:
    R = A.A / scales
    if np.linalg.det(R) < 0.0:
        R = R * np.array([-1.0, 1.0, 1.0])  # all these shapes are mirror images of themselves
    return Affine(R, A.t).pose()


def _same(a: float, b: float) -> bool:
    return abs(a - b) <= EVEN * max(a, b)


def _box(A: Affine, edges: Array) -> UsdShape:
    scales = _scales(A)
    if scales is not None:
        sizes = tuple(float(x) for x in edges * scales)
        return UsdShape("box", sizes, _pose(A, scales), *_NOTHING)
    return _hull(A.points(box_corners(0.5 * edges)))


def _ball(A: Affine, radius: float) -> UsdShape:
    scales = _scales(A)
    if scales is not None and _same(float(scales.min()), float(scales.max())):
        return UsdShape("sphere", (radius * float(scales.max()),), pin.SE3(np.eye(3), A.t), *_NOTHING)
    return _hull(A.points(ellipsoid_hull(radius, radius, radius)[0]))


def _round(stage: UsdStage, prim: Any, kind: str, A: Affine) -> UsdShape:
    """A cylinder, capsule or cone about z."""
    single = prim.GetAttribute("radius")
    bottom, top = (
        _size(stage, prim, "radius" if single else name, 1.0 if kind != "Capsule" else 0.5)
        for name in ("radiusBottom", "radiusTop")
    )
    height = _size(stage, prim, "height", 2.0 if kind != "Capsule" else 1.0, kind == "Capsule")
    scales = _scales(A)
    if kind != "Cone" and bottom == top and scales is not None and _same(float(scales[0]), float(scales[1])):
        radius, length = bottom * float(scales[:2].max()), height * float(scales[2])
        if kind == "Cylinder" or _same(float(scales[0]), float(scales[2])):
            return UsdShape(kind.lower(), (radius, length), _pose(A, scales), *_NOTHING)
    if kind == "Capsule":
        ends = [
            ellipsoid_hull(r, r, r)[0] + np.array([0.0, 0.0, z])
            for r, z in ((bottom, -0.5 * height), (top, 0.5 * height))
        ]
        return _hull(A.points(np.concatenate(ends)))
    return _hull(A.points(frustum_hull(bottom, 0.0 if kind == "Cone" else top, height)[0]))


def _hull(points: Array) -> UsdShape:
    """The convex hull of points (k, 3), with triangles whose normals point out.

    Raises:
        QhullError: the points are flat.
    """
    hull = plain_hull(points)
    return UsdShape("mesh", (), pin.SE3.Identity(), hull.vertices, hull.triangles, convex=True)


def _mesh(stage: UsdStage, prim: Any, A: Affine, collides: bool) -> UsdShape:
    points = np.array(stage.value(prim, "points", []), float).reshape(-1, 3)
    counts = np.array(stage.value(prim, "faceVertexCounts", []), int)
    index = np.array(stage.value(prim, "faceVertexIndices", []), int)
    if not len(points) or not len(counts) or len(index) != counts.sum() or (counts < 3).any():
        told = f"{len(points)} points, {len(counts)} faces and {len(index)} of their corners"
        raise stage.issue(prim, told, "a mesh whose faces have three corners or more, each a point")
    if index.min() < 0 or index.max() >= len(points):
        raise stage.issue(prim, f"a corner {int(index.max())} of {len(points)} points", "indices of points")
    if not np.isfinite(points).all():
        raise stage.issue(prim, "points that are no numbers", "finite numbers", "points")
    placed = A.points(points)
    approximation = str(stage.value(prim, "physics:approximation", "none")) if collides else "none"
    try:
        if approximation == "convexHull":
            return _hull(placed)
        if approximation == "boundingCube":
            low, high = points.min(axis=0), points.max(axis=0)
            return _box(Affine(A.A, A.points(0.5 * (low + high)[None])[0]), high - low)
    except QhullError as error:
        raise stage.issue(prim, "flat points", "a mesh with a volume", "points") from error
    if approximation == "boundingSphere":
        centre = 0.5 * (placed.min(axis=0) + placed.max(axis=0))
        radius = float(np.linalg.norm(placed - centre, axis=1).max())
        return UsdShape("sphere", (radius,), pin.SE3(np.eye(3), centre), *_NOTHING)
    placed, merged = np.unique(placed, axis=0, return_inverse=True)
    triangles = _fans(counts, merged.reshape(-1)[index])
    used, merged = np.unique(triangles, return_inverse=True)
    placed, triangles = placed[used], merged.reshape(-1, 3)
    flipped = str(stage.value(prim, "orientation", "rightHanded")) == "leftHanded"
    if flipped != (np.linalg.det(A.A) < 0.0):
        triangles = triangles[:, ::-1]
    return UsdShape("mesh", (), pin.SE3.Identity(), placed, triangles)


def _fans(counts: Array, index: Array) -> Triangles:
    """Every face as a fan of triangles around its first corner."""
    first = np.concatenate([[0], np.cumsum(counts)[:-1]])
    pieces = []
    for size in np.unique(counts):
        starts = first[counts == size]
        for k in range(1, int(size) - 1):
            pieces.append(np.stack([index[starts], index[starts + k], index[starts + k + 1]], axis=1))
    triangles = np.concatenate(pieces)
    kept = (
        (triangles[:, 0] != triangles[:, 1])
        & (triangles[:, 1] != triangles[:, 2])
        & (triangles[:, 0] != triangles[:, 2])
    )
    return np.asarray(triangles[kept])
