"""Clearances of links that one or two joints move against each other, proved once for all configurations of a robot.

Neighbours often pass each other at a fraction of a millimetre, wherever their joint stands. Along a motion that takes
thousands of distances of meshes, again and again. But their distance is a function of one angle: it is proved here over
the whole range of the joint, by the same bodies, distances and bounds of motion as the certificate, and kept by the
content of the robot. What is kept says nothing of a motion: the certificate looks up where its joints go, and divides
the interval as ever where nothing was proved.
"""

import io
from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields
from functools import cached_property

import coal
import numpy as np

from optiplan import cache
from optiplan.arrays import Array, Flags, Index
from optiplan.collision.model import CollisionModel
from optiplan.geometry.coal_queries import coal_mesh
from optiplan.geometry.convex import mesh_triangles, mesh_vertices
from optiplan.geometry.scene import Scene
from optiplan.records import dataclass
from optiplan.robot.loaded_robots import once_for_each_robot
from optiplan.robot.robot import Robot
from optiplan.robot.self_collision.pair_proof import joint_box
from optiplan.robot.self_collision.pair_survey import content_digest
from optiplan.verify.continuous.bodies import Bodies
from optiplan.verify.continuous.motion_bounds import Boxes, Motion, MotionQuery
from optiplan.verify.continuous.separating_planes import PairDistances, unconfirmed
from optiplan.verify.tolerances import CLEARANCE_ROUNDING

VERSION = 3
"""Counted up when clearances are proved in another way, so that what is kept is made again."""

_FINE = 0.01
"""m: more is not proved of a pair."""

_SHARE = {1: 0.7, 2: 0.5}
"""By how many joints move a pair: share of the distance measured in a box that is proved of all of it."""

_MOST = {1: 8000, 2: 2000}
"""Boxes looked at for a pair; those open after that stay unproved."""

_IN_ALL = 6_000
"""Boxes looked at for all pairs of two joints together, shared evenly: of links that are many meshes there are many."""

_HALVINGS = {1: 12, 2: 7}
"""Of the range of a joint: shorter boxes stay unproved."""

_ANGLES = 33
"""Places over the range of a joint at which neighbours are measured first."""

_RINGS = 0.9
"""Share of the distance at most of these places that neighbours are proved to keep at every angle."""

_SEAM = 1e-9
"""rad or m, by which boxes are larger where they are looked up: rounding of angles."""

_CHUNK = 512
"""Boxes handled at once."""

Progress = Callable[[str, float], None]
"""Called with the names of two links and the share of pairs done."""


@dataclass(frozen=True, eq=False)
class KeptClearance:
    """What is proved of a pair of bodies in N boxes that fill the ranges of the m joints that move it.

    Attributes:
        joints: (m,) planned joints; `endless` (m,): whether the range is a whole turn, so that angles count modulo it.
        middle: (N, m) of the boxes; `half` (N, m): their half widths, rad or m.
        clearance: (N,) m: the pair comes no nearer in a box. -inf where nothing is proved.
    """

    joints: Index
    endless: Flags
    middle: Array
    half: Array
    clearance: Array

    def least(self, q: Array, reach: Array) -> Array:
        """Return the clearance, (K,) m, proved while |q_j' - q_j| <= reach_j; q, reach (K, n).

        -inf beyond the range.
        """
        q, reach = q[:, self.joints], reach[:, self.joints]
        low, high = self._range
        first, last = (q - reach).min(axis=0), (q + reach).max(axis=0)
        near = self._meet(0.5 * (first + last)[None], 0.5 * (last - first)[None], np.arange(len(self.middle)))[0]
        chosen = np.flatnonzero(near)
        result = np.full(len(q), np.inf)
        for k in range(0, len(q), _CHUNK):
            part = slice(k, k + _CHUNK)
            meets = self._meet(q[part], reach[part], chosen)
            result[part] = np.where(meets, self.clearance[chosen], np.inf).min(axis=1, initial=np.inf)
        within = (((q - reach >= low) & (q + reach <= high)) | self.endless).all(axis=1)
        result[~within | ~np.isfinite(result)] = -np.inf
        return result

    @cached_property
    def _range(self) -> tuple[Array, Array]:
        return (self.middle - self.half).min(axis=0), (self.middle + self.half).max(axis=0)

    def _meet(self, q: Array, reach: Array, boxes: Index) -> Flags:
        """Whether |q' - q| <= reach, (K, m) each, meets some of the boxes (B,): (K, B)."""
        found = np.ones((len(q), len(boxes)), dtype=bool)
        for j, endless in enumerate(self.endless.tolist()):
            apart = np.abs(q[:, j, None] - self.middle[boxes, j])
            if endless:
                apart = np.abs((apart + np.pi) % (2.0 * np.pi) - np.pi)
            found &= apart <= reach[:, j, None] + self.half[boxes, j] + _SEAM
        return found


Pair = tuple[int, int]


def prove_kept_clearances(robot: Robot, progress: Progress | None = None) -> Mapping[Pair, KeptClearance]:
    """Return what is kept of the pairs of a robot's bodies; it is proved now where it is not in the cache.

    Args:
        robot: of which only the joints and bodies count, not where it stands and what it carries.
        progress: told of pairs being proved.
    """
    if robot.held:  # of joints that stand still the whole robot's ranges are not asked
        return {}
    content = cache.load(_file(robot))
    if content is not None:
        return _unpack(content)
    made = _Maker(robot.unmounted).make(progress or (lambda words, done: None))
    cache.store(_file(robot), _pack(made))
    return made


def clearances_are_kept(robot: Robot) -> bool:
    """Whether nothing is left to prove: the file is there, or there is no pair to prove."""
    return bool(robot.held) or cache.has(_file(robot))


@once_for_each_robot
def _file(bare: Robot) -> str:
    limits = (bare.limits.lower, bare.limits.upper)
    return f"clearances/{content_digest(bare.model, bare.geometry, limits, VERSION)}.npz"


kept_clearances = once_for_each_robot(prove_kept_clearances)
"""The same, made once in a process for each robot."""


class _Maker:
    """Proves the pairs of a robot: the certificate's tools, and boxes of configurations in place of intervals."""

    def __init__(self, robot: Robot) -> None:
        self._robot, self._model = robot, CollisionModel(robot, Scene())
        self._most = dict(_MOST)
        self._bodies = Bodies(self._model)
        self._distances, self._motion = PairDistances(self._model, self._bodies), Motion(self._bodies)
        kinematics = self._model.kinematics
        follows = np.abs(kinematics.coupling) > 0.0
        self._turns: Flags = (follows.sum(axis=0) == 1) & (kinematics.revolute @ follows > 0.5)
        self._middle, self._half = joint_box(self._turns, robot.limits.lower, robot.limits.upper)
        self._shapes = [body.geometry for body in self._model.geometry.geometryObjects]

    def make(self, progress: Progress) -> dict[Pair, KeptClearance]:
        """Prove the pairs of one joint, and those of two of which a body is a mesh."""
        found: dict[Pair, KeptClearance] = {}
        if self._bodies.unsupported is not None:
            return found
        chosen = list(self._chosen())
        self._most[2] = min(_MOST[2], _IN_ALL // max(1, sum(len(joints) == 2 for _, joints in chosen)))
        for done, (k, joints) in enumerate(chosen):
            a, b = self._model.bounds.pairs[k].tolist()
            progress(f"{self._model.names[a]} – {self._model.names[b]}", done / len(chosen))
            one = self._of_one(k, joints) if len(joints) == 1 else self._divided(k, joints)
            if np.isfinite(one.clearance).any():
                found[a, b] = one
        return found

    def _chosen(self) -> Iterator[tuple[int, Index]]:
        """Yield the pairs to prove, and the joints that move each."""
        for k, bodies in enumerate(self._model.bounds.pairs.tolist()):
            joints = np.flatnonzero(self._model.bounds.depends[k])
            mesh = any(isinstance(self._shapes[body], coal.BVHModelBase) for body in bodies)
            if (len(joints) == 1 or (len(joints) == 2 and mesh)) and np.isfinite(self._half[joints]).all():
                yield k, joints

    def _of_one(self, pair: int, joints: Index) -> KeptClearance:
        """Prove a pair that one joint moves: by rings about its axis where both are polyhedra, else by division."""
        from optiplan.verify.continuous.rings import near_rings

        whole = self._middle[joints][None], self._half[joints][None]
        surfaces = self._surfaces(pair, int(joints[0]))
        if surfaces is None:
            return self._divided(pair, joints)
        places = np.linspace(-1.0, 1.0, _ANGLES)[:, None]
        measured = self._measured(pair, joints, whole[0] + places * whole[1])
        apart = measured[measured > 10.0 * CLEARANCE_ROUNDING]
        if not len(apart):
            return self._table(joints, *whole, np.array([-np.inf]))
        gap = _RINGS * float(np.quantile(apart, 0.25))
        if gap > _FINE:
            return self._divided(pair, joints)
        near = near_rings(*surfaces, gap)
        left = [triangles[flags] for triangles, flags in zip(surfaces, near, strict=True)]
        if not all(map(len, left)):
            # Surfaces that meet at no angle are inside each other at all angles or at none.
            clearance = gap - CLEARANCE_ROUNDING if (measured > 0.0).all() else -np.inf
            return self._table(joints, *whole, np.array([clearance]))
        return self._outside(pair, self._divided(pair, joints, _Residue(left, gap)))

    def _divided(self, pair: int, joints: Index, residue: "_Residue | None" = None) -> KeptClearance:
        """Halve boxes until each is proved, or shorter or more than what is worth it."""
        count = len(joints)
        middle, half = self._middle[joints][None], self._half[joints][None]
        done: list[tuple[Array, Array, Array]] = []
        spent = 0
        while len(middle) and spent < self._most[count]:
            spent += len(middle)
            if residue is None:
                bound, travel = self._bounds(pair, joints, middle, half)
            else:
                bound, travel = residue.bounds(middle[:, 0] - self._middle[joints[0]], half[:, 0])
            clearance = bound - travel - CLEARANCE_ROUNDING
            enough = clearance >= np.minimum(_SHARE[count] * bound, _FINE)
            proved = (clearance > CLEARANCE_ROUNDING) & enough
            short = (half <= self._half[joints] * 0.5 ** _HALVINGS[count]).all(axis=1)
            ended = proved | short
            done.append(
                (middle[ended], half[ended], np.where(clearance > CLEARANCE_ROUNDING, clearance, -np.inf)[ended])
            )
            middle, half = _halved(middle[~ended], half[~ended], self._half[joints])
        done.append((middle, half, np.full(len(middle), -np.inf)))
        return self._table(joints, *(np.concatenate(column) for column in zip(*done, strict=True)))

    def _table(self, joints: Index, middle: Array, half: Array, clearance: Array) -> KeptClearance:
        endless = self._turns[joints] & (self._half[joints] >= np.pi)
        return KeptClearance(joints, endless, middle, half, clearance)

    def _outside(self, pair: int, table: KeptClearance) -> KeptClearance:
        """Leave out runs of boxes in which one body is inside the other: of surfaces, the distance does not tell."""
        order = np.argsort(table.middle[:, 0])
        clearance = table.clearance.copy()
        proved = np.isfinite(clearance[order])
        for run in np.split(order, np.flatnonzero(np.diff(proved)) + 1):
            if np.isfinite(clearance[run[0]]) and self._measured(pair, table.joints, table.middle[run[:1]])[0] <= 0.0:
                clearance[run] = -np.inf
        return KeptClearance(table.joints, table.endless, table.middle, table.half, clearance)

    def _configurations(self, joints: Index, at: Array) -> Array:
        Q = np.tile(np.where(np.isfinite(self._half), self._middle, 0.0), (len(at), 1))
        Q[:, joints] = at
        return Q

    def _measured(self, pair: int, joints: Index, at: Array) -> Array:
        """Lower bounds, (K,) m, of the distance of the bodies themselves at joints (K, m), confirmed by planes."""
        poses = self._model.kinematics.poses(self._configurations(joints, at))
        pairs = np.full(len(at), pair)
        return self._distances.query(pairs, self._bodies.place(poses, np.arange(len(at)), pairs)).bound

    def _bounds(self, pair: int, joints: Index, middle: Array, half: Array) -> tuple[Array, Array]:
        """Lower bounds of the distance in the middles of boxes (K, m), and how far bodies can move there: (K,) m."""
        found = [
            self._bounds_of(pair, joints, middle[k : k + _CHUNK], half[k : k + _CHUNK])
            for k in range(0, len(middle), _CHUNK)
        ]
        bound, travel = (np.concatenate(column) for column in zip(*found, strict=True))
        return bound, travel

    def _bounds_of(self, pair: int, joints: Index, middle: Array, half: Array) -> tuple[Array, Array]:
        kinematics, rows = self._model.kinematics, np.arange(len(middle))
        Q, D = self._configurations(joints, middle), np.zeros((len(middle), self._robot.n))
        D[:, joints] = half
        still = np.zeros_like(Q)
        poses = kinematics.poses(Q)
        pairs = np.full(len(Q), pair)
        placed = self._bodies.place(poses, rows, pairs)
        boxes = self._motion.of_all_joints(Boxes(still[:, 0], Q, still, D, still, still, still))
        travel = self._motion.travel(boxes, MotionQuery(rows, pairs, placed, *kinematics.axes(poses))).total
        bound = self._bodies.lower_bound(placed)
        near = np.flatnonzero(bound - travel - CLEARANCE_ROUNDING < _FINE)
        enough = travel[near] + _FINE + CLEARANCE_ROUNDING
        bound[near] = np.maximum(bound[near], self._distances.query(pairs[near], placed.take(near), enough).bound)
        return bound, travel

    def _surfaces(self, pair: int, joint: int) -> tuple[Array, Array] | None:
        """Triangles (k, 3, 3) of both bodies at the middle of the joint, in a frame whose z axis is the joint's.

        Those of the body that the joint turns come second.
        """
        moved = np.flatnonzero(self._bodies.moves[pair].any(axis=0))
        bodies = self._bodies.pairs[pair]
        kinematics = self._model.kinematics
        if len(moved) != 1 or kinematics.revolute[moved[0]] < 0.5 or not self._turns[joint]:
            return None
        found = [_triangles(self._shapes[body]) for body in bodies]
        poses = kinematics.poses(self._configurations(np.array([joint]), self._middle[[joint]][None]))
        placed = self._bodies.place(poses, np.zeros(1, dtype=np.intp), np.array([pair])).poses[0]
        direction, point = (part[0, moved[0]] for part in kinematics.axes(poses))
        across = np.linalg.svd(direction[None])[2]
        axes = np.array([across[1], np.cross(direction, across[1]), direction])
        one, other = (
            None if own is None else (own @ X[:3, :3].T + X[:3, 3] - point) @ axes.T
            for own, X in zip(found, placed, strict=True)
        )
        if one is None or other is None:
            return None
        return (one, other) if self._bodies.moves[pair, 1].any() else (other, one)


class _Residue:
    """Two surfaces of which all other triangles stay `gap` apart at every angle, the second turned about the z axis."""

    def __init__(self, surfaces: list[Array], gap: float) -> None:
        self._surfaces, self._gap = [coal_mesh(triangles.reshape(-1, 3)) for triangles in surfaces], gap
        # How far the nearer one's points are from the axis: either may be taken as the one that turns.
        self._radius = min(float(np.linalg.norm(own[..., :2], axis=2).max()) for own in surfaces)

    def bounds(self, angle: Array, half: Array) -> tuple[Array, Array]:
        """Lower bounds, (K,) m, of the distance at angles (K,), rad, and how far points move within `half` of them."""
        still, turned, result = coal.Transform3s(), coal.Transform3s(), coal.DistanceResult()
        request, found = coal.DistanceRequest(), np.empty(len(angle))
        request.gjk_tolerance, request.gjk_max_iterations = 1e-9, 500
        for k, (c, s) in enumerate(zip(np.cos(angle).tolist(), np.sin(angle).tolist(), strict=True)):
            turned.setRotation(np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]))
            result.clear()
            found[k] = coal.distance(self._surfaces[0], still, self._surfaces[1], turned, request, result)
        travel = 2.0 * np.sin(0.5 * np.minimum(half, np.pi)) * self._radius
        # Beyond the gap nothing is known of the other triangles, which travel does not concern.
        return np.minimum(unconfirmed(found), self._gap + travel), travel


def _halved(middle: Array, half: Array, whole: Array) -> tuple[Array, Array]:
    """Boxes (K, m) halved along the joint of which they hold the largest share of its range."""
    longest = (half / whole).argmax(axis=1)
    rows = np.arange(len(half))
    shorter, step = half.copy(), np.zeros_like(half)
    shorter[rows, longest] *= 0.5
    step[rows, longest] = shorter[rows, longest]
    return np.concatenate([middle - step, middle + step]), np.tile(shorter, (2, 1))


def _triangles(shape: coal.CollisionGeometry) -> Array | None:
    """Triangles (k, 3, 3), m, of the surface of a mesh or polyhedron; None of other shapes."""
    if isinstance(shape, coal.BVHModelBase):
        return np.asarray(mesh_vertices(shape)[mesh_triangles(shape)])
    if isinstance(shape, coal.ConvexBase):
        from scipy.spatial import ConvexHull, QhullError

        points = np.array(shape.points())
        try:
            return np.asarray(points[ConvexHull(points).simplices])
        except QhullError:
            return None
    return None


def _pack(tables: Mapping[Pair, KeptClearance]) -> bytes:
    arrays: dict[str, Array | Index | Flags] = {"pairs": np.array(list(tables), dtype=np.intp).reshape(-1, 2)}
    for k, table in enumerate(tables.values()):
        arrays |= {f"{field.name}{k}": getattr(table, field.name) for field in fields(table)}
    buffer = io.BytesIO()
    np.savez_compressed(buffer, allow_pickle=False, **arrays)
    return buffer.getvalue()


def _unpack(content: bytes) -> dict[Pair, KeptClearance]:
    names = [field.name for field in fields(KeptClearance)]
    with np.load(io.BytesIO(content)) as data:
        return {
            (int(a), int(b)): KeptClearance(*(data[f"{name}{k}"] for name in names))
            for k, (a, b) in enumerate(data["pairs"])
        }
