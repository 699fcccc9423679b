"""Bodies swallowed by a mesh: a mesh is a surface, and the distance to it does not tell inside from outside."""

import coal
import numpy as np

from optiplan.arrays import Array
from optiplan.verify.bodies import Bodies, Index


def swallowed(bodies: Bodies, joint_poses: Array) -> tuple[int, Array] | None:
    """A pair of which one body has a point inside the mesh that is the other: (pair, point (3,) in the world), or None.

    One point of a body decides for all of it as long as the surfaces stay apart, which the certificate proves; so this
    needs to hold at one time only. Of a mesh in several shells only the shell of its first vertex is looked at.

    Args:
        bodies: the bodies.
        joint_poses: (n + 1, 4, 4) poses of the joints in the world.
    """
    meshes, planes = bodies.kind(coal.BVHModelBase), bodies.kind(coal.Halfspace)
    for pair, side in np.argwhere(meshes & ~planes[:, ::-1]):
        mesh, other = bodies.pairs[pair, side], bodies.pairs[pair, 1 - side]
        vertices = bodies.vertices[other]
        X_WO = joint_poses[bodies.joints[other]] @ bodies.placements[other]
        X_WM = joint_poses[bodies.joints[mesh]] @ bodies.placements[mesh]
        p_O = vertices[0] if len(vertices) else bodies.centre[other]
        p_W = X_WO[:3, :3] @ p_O + X_WO[:3, 3]
        p_M = X_WM[:3, :3].T @ (p_W - X_WM[:3, 3])
        corners = bodies.vertices[mesh]
        outside = (p_M < corners.min(axis=0)).any() or (p_M > corners.max(axis=0)).any()
        if not outside and abs(winding_number(corners[_triangles(bodies.shapes[mesh])], p_M)) > 0.5:
            return int(pair), p_W
    return None


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


def _triangles(mesh: coal.BVHModelBase) -> Index:
    """Vertex indices of every triangle: (k, 3)."""
    found = [mesh.tri_indices(i) for i in range(mesh.num_tris)]
    return np.array([[t[0], t[1], t[2]] for t in found], dtype=np.intp).reshape(-1, 3)
