"""Bodies swallowed by a mesh: a mesh is a surface, and the distance to it does not tell inside from outside."""

import coal
import numpy as np

from optiplan.arrays import Array
from optiplan.model.convex import triangles_of
from optiplan.verify.bodies import Bodies


def swallowed(bodies: Bodies, joint_poses: Array) -> tuple[int, Array] | None:
    """A pair of which one body has a point inside the mesh that is the other: (pair, point (3,) in the world), or None.

    One point of every connected part of a body decides for all of it as long as the surfaces stay apart, which the
    certificate proves; so this needs to hold at one time only.

    Args:
        bodies: the bodies.
        joint_poses: (n + 1, 4, 4) poses of the joints in the world.
    """
    meshes, planes = bodies.kind(coal.BVHModelBase), bodies.kind(coal.Halfspace)
    points: dict[int, Array] = {}
    for pair, side in np.argwhere(meshes & ~planes[:, ::-1]):
        mesh, other = bodies.pairs[pair, side], bodies.pairs[pair, 1 - side]
        if other not in points:
            points[other] = _one_point_a_part(bodies, other)
        X_WO = joint_poses[bodies.joints[other]] @ bodies.placements[other]
        X_WM = joint_poses[bodies.joints[mesh]] @ bodies.placements[mesh]
        p_W = points[other] @ X_WO[:3, :3].T + X_WO[:3, 3]
        p_M = (p_W - X_WM[:3, 3]) @ X_WM[:3, :3]
        corners = bodies.vertices[mesh]
        near = ((p_M >= corners.min(axis=0)) & (p_M <= corners.max(axis=0))).all(axis=1)
        if not near.any():
            continue
        triangles = corners[triangles_of(bodies.shapes[mesh])]
        for k in np.flatnonzero(near):
            if abs(winding_number(triangles, p_M[k])) > 0.5:
                return int(pair), p_W[k]
    return None


def _one_point_a_part(bodies: Bodies, body: int) -> Array:
    """A point of every connected part of a body, in its own frame: (k, 3), m."""
    shape, vertices = bodies.shapes[body], bodies.vertices[body]
    if not isinstance(shape, coal.BVHModelBase):
        return np.asarray(vertices[:1] if len(vertices) else bodies.centre[[body]])
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    distinct, same = np.unique(vertices, axis=0, return_inverse=True)
    corners = same.reshape(-1)[triangles_of(shape)]
    joined = (np.ones(2 * len(corners)), (corners[:, [0, 1]].ravel(), corners[:, [1, 2]].ravel()))
    _, part = connected_components(coo_matrix(joined, shape=(len(distinct), len(distinct))), directed=False)
    _, first = np.unique(part[corners[:, 0]], return_index=True)
    return np.asarray(distinct[corners[first, 0]])


def winding_number(triangles: Array, point: Array) -> float:
    """How often triangles (k, 3, 3) wind around a point (3,): 0 outside a closed surface, 1 or -1 inside.

    Sum of solid angles over 4 pi, with tan(angle / 2) = a . (b x c) / (abc + (a . b) c + (b . c) a + (c . a) b).
    Source: van Oosterom and Strackee, IEEE Trans. Biomed. Eng. 30 (1983).
    """
    a, b, c = np.moveaxis(triangles - point, 1, 0)
    x, y, z = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    volume = np.einsum("ki,ki->k", a, np.cross(b, c))
    ab, bc, ca = (np.einsum("ki,ki->k", u, v) for u, v in ((a, b), (b, c), (c, a)))
    angle = 2.0 * np.arctan2(volume, x * y * z + ab * z + bc * x + ca * y)
    return float(angle.sum() / (4.0 * np.pi))
