"""Pairs proved apart by separating planes in the native core, on the certificate's own geometry.

The core's part is `_core/src/verify/plane_proof`: forward kinematics, support functions and bounds of motion, written
for this proof alone. Of what planners use, it calls the search for distances, which only proposes normals.
"""

from copy import copy
from typing import TYPE_CHECKING, NamedTuple
from weakref import WeakKeyDictionary

import coal
import numpy as np
import numpy.typing as npt
import pinocchio as pin

from optiplan._core import core
from optiplan.arrays import Array, Flags, Index, distinct
from optiplan.collision.model import CollisionModel, SameBodies
from optiplan.collision.native_model import native_hull, native_shape
from optiplan.records import dataclass
from optiplan.robot.loaded_robots import once_for_each
from optiplan.robot.mimic_joints import coupling, screws
from optiplan.robot.robot import Robot
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.continuous.bodies import BodyShape, bodies_of_links, parts_of_link
from optiplan.verify.continuous.intervals import Intervals
from optiplan.verify.continuous.motion_tools import MotionTools
from optiplan.verify.report import VerifyPolicy

if TYPE_CHECKING:
    from optiplan._core._core_base import PlaneProof, ProvedMotion, ProvedShape

PROVED_SHARE = 0.8
"""Of the smallest distance measured that is proved as clearance."""

FAR = 0.1
"""m: a larger clearance is not refined."""

_MOST, _MOST_OF_INTERVAL = 50_000, 4
"""Normals proposed, or intervals, after which the core gives up; of a long motion, this many of each interval given."""

_MOST_DEGREE, _MOST_STEP = 15, 1e-6
"""Of polynomials that the core's buffers hold; rad or m, steps of position that its bounds are made for."""

Gap = tuple[float, float, int]
"""The smallest gap of a kind, m, its time, s, and the pair; -1 where there is none."""


class PlanesFound(NamedTuple):
    """What planes prove.

    Attributes:
        least: (2,) the clearance proved of both kinds of pairs, m; inf where there is no pair.
        nearest: the smallest gap met of each kind.
        left: items that are not proved.
        intervals: checked; `queries`: normals proposed.
    """

    least: Array
    nearest: tuple[Gap, Gap]
    left: Intervals
    intervals: int
    queries: int


class PlaneSearch:
    """The proof of items of a work space by planes.

    Args:
        model: the work space.
        tools: of it.
    """

    def __init__(self, model: CollisionModel, tools: MotionTools) -> None:
        bodies, self.tops = tools.bodies, tools.bodies.tree.tops
        every = _EveryPair.of(model, tools)
        self._top, self._carriers = every.top, every.carriers
        parts = [part for _, part in every.parts]
        found = [_proved(known) for known in (*bodies.known, *parts)]
        shapes = [shape for shape in found if shape is not None]
        self.known = len(shapes) == len(found)
        balls = np.array([[*part.centre, *[part.radius] * 4] for part in parts]).reshape(-1, 7)
        volumes = np.column_stack([bodies.centre, bodies.half, bodies.radius])
        if self.known:
            self._core: PlaneProof = core.PlaneProof.of(
                *_joints_of(model.model),
                shapes,
                bodies.joints[self._carriers].astype(np.int64),
                self._poses(tools),
                np.ascontiguousarray(np.vstack([volumes, balls])),
                every.pairs.astype(np.int64),
                every.kinds.astype(np.int64),
                every.exact.astype(np.int64),
                every.first.astype(np.int64),
                every.members.astype(np.int64),
            )

    def _poses(self, tools: MotionTools) -> Array:
        return np.ascontiguousarray(tools.bodies.placements[self._carriers])

    def with_obstacles_of(self, tools: MotionTools) -> "PlaneSearch":
        """Return the same of a work space in which obstacles stand elsewhere."""
        twin = copy(self)
        if self.known:
            twin._core = self._core.placed(self._poses(tools))
        return twin

    def begin(
        self, trajectory: Trajectory, jump: Array, intervals: Intervals, pairs: Index, some: tuple[Index, Index]
    ) -> "PlanesAsked | None":
        """Return the intervals in the form of the core; None where its buffers or bounds do not suffice.

        Args:
            trajectory: the motion.
            jump: (m, n) steps of position at the ends of its pieces.
            intervals: of time.
            pairs: (T,) to prove on all of them.
            some: rows (K,) of intervals, rising, and further pairs (K,) to prove there.
        """
        few = trajectory.coefficients.shape[1] <= _MOST_DEGREE + 1 and jump.max(initial=0.0) <= _MOST_STEP
        if not (self.known and few):
            return None
        count, (rows, others) = len(intervals.piece), some
        first = np.searchsorted(rows, np.arange(count + 1))
        widths = intervals.widths(trajectory)
        motion = self._core.motion(
            np.ascontiguousarray(trajectory.breakpoints),
            np.ascontiguousarray(trajectory.coefficients),
            np.ascontiguousarray(jump),
            intervals.piece.astype(np.int64),
            np.ascontiguousarray((intervals.index + 0.5) * widths),
            0.5 * widths,
            pairs.astype(np.int64),
            first.astype(np.int64),
            others.astype(np.int64),
        )
        return PlanesAsked(self._core, self._top, motion, intervals)


@dataclass(frozen=True, eq=False)
class PlanesAsked:
    """Intervals of a motion before the core.

    Attributes:
        core: proves.
        top: the pair of the model, or of hulls, that each pair of the core belongs to.
        motion: with its intervals and their pairs, in the form of the core.
        intervals: of time.
    """

    core: "PlaneProof"
    top: Index
    motion: "ProvedMotion"
    intervals: Intervals

    def nearest(self, clearance: float) -> list[Gap] | None:
        """Return where pairs are nearest in the middles of intervals; None where bodies touch there.

        Those between outlines that hold bodies are among them, where no bodies are known to be nearer.
        """
        given_up, _, nearest, hulls, *_ = self.core.scan(self.motion, clearance)
        if given_up:
            return None
        found = [*nearest, *(hull for hull, one in zip(hulls, nearest, strict=True) if hull[0] < one[0])]
        return [self._named(one) for one in found if one[2] >= 0]

    def prove(self, policy: VerifyPolicy, cap: Array, measured: Array) -> PlanesFound | None:
        """Prove what planes can; None where bodies touch or it takes too long.

        Args:
            policy: the required clearance, and when to give up.
            cap: (2,) the most that is proved of each kind, m.
            measured: (2,) the smallest distances known, m.
        """
        asked = np.array([policy.clearance, PROVED_SHARE, FAR, *cap, policy.min_interval])
        most = max(_MOST, _MOST_OF_INTERVAL * len(self.intervals.piece))
        given_up, least, nearest, _, rows, pairs, intervals, queries = self.core.prove(
            self.motion, asked, np.ascontiguousarray(measured), most, min(most, policy.max_queries)
        )
        if given_up:
            return None
        left = self.intervals.take(rows.astype(np.intp))
        left = Intervals(left.piece, left.level, left.index, pairs.astype(np.intp))
        own, scene = (self._named(one) for one in nearest)
        return PlanesFound(np.array(least), (own, scene), left, intervals, queries)

    def _named(self, gap: Gap) -> Gap:
        return gap[0], gap[1], int(self.top[gap[2]]) if gap[2] >= 0 else -1


class _EveryPair(NamedTuple):
    """The pairs of a tree, then those of the parts of links that are meshes.

    Attributes:
        pairs: (Q, 2) bodies; `kinds`, `exact` (Q,): see `ProvedPair` of the core.
        first: (Q + 1,) where the pairs begin that tell more of each, in `members`.
        top: (Q,) the pair of the tree that each belongs to.
        parts: (mesh, part) of the bodies behind those of the tree.
        carriers: (G,) the body of the tree that each body is, or is a part of.
    """

    pairs: Index
    kinds: Index
    exact: Flags
    first: Index
    members: Index
    top: Index
    parts: list[tuple[int, BodyShape]]
    carriers: Index

    @classmethod
    def of(cls, model: CollisionModel, tools: MotionTools) -> "_EveryPair":
        tree, bodies, meshes = tools.bodies.tree, len(tools.bodies.shapes), tools.distances.link_meshes
        pairs, top = [tools.bodies.pairs], [np.arange(len(tools.bodies.pairs))]
        members: dict[int, Index] = dict(tree.parts)
        parts: list[tuple[int, BodyShape]] = []
        count, cut = len(pairs[0]), np.zeros(len(pairs[0]), dtype=bool)
        cut[tree.count :] = True  # those of hulls have parts
        for side in (0, 1):
            for mesh in distinct(tree.pairs[: tree.count][meshes[: tree.count, side], side]).tolist():
                own = np.flatnonzero(meshes[:, side] & (tree.pairs[:, side] == mesh) & ~cut)
                cut[own] = True
                made = parts_of_link(model.robot, mesh)
                fresh = np.empty((len(own), len(made), 2), dtype=np.intp)
                fresh[:, :, side] = bodies + len(parts) + np.arange(len(made))
                fresh[:, :, 1 - side] = tree.pairs[own, 1 - side][:, None]
                parts += [(mesh, part) for part in made]
                for k, pair in enumerate(own.tolist()):
                    members[pair] = count + k * len(made) + np.arange(len(made))
                count += fresh.shape[0] * fresh.shape[1]
                pairs.append(fresh.reshape(-1, 2))
                top.append(np.repeat(own, len(made)))
        tops, sizes = np.concatenate(top), np.zeros(count, dtype=np.intp)
        sizes[list(members)] = [len(found) for found in members.values()]
        exact = np.zeros(count, dtype=bool)
        exact[: tree.count] = tools.distances.convex[: tree.count]
        return cls(
            np.vstack(pairs),
            tools.kinds[tops],
            exact,
            np.concatenate([[0], np.cumsum(sizes)]),
            np.concatenate([np.empty(0, dtype=np.intp), *(members[k] for k in sorted(members))]),
            tops,
            parts,
            np.array([*range(bodies), *(mesh for mesh, _ in parts)], dtype=np.intp),
        )


@once_for_each
def _proved(known: BodyShape) -> "ProvedShape | None":
    """Return a body for the core; None for a shape that it does not know."""
    points = np.ascontiguousarray(known.vertices, dtype=np.float64).reshape(-1, 3)
    round_ = np.array(known.round or (0.0,) * 5)
    flat = isinstance(known.shape, coal.Halfspace)
    if not (len(points) or known.round is not None or flat):
        return None
    outline = native_hull(points) if len(points) else native_shape(known.shape)  # the planners': it proposes normals
    return None if outline is None else core.ProvedShape.of(outline, round_, points)


def make_shapes(robot: Robot) -> None:
    """Give the core the robot's own bodies, and their hulls, for proofs, where it has them not yet."""
    if core is not None:
        for known in bodies_of_links(robot):
            _proved(known)


class _Joints(NamedTuple):
    """Joints for the core: parents, placements, axes, which turn, A and b of positions A q + b."""

    parents: npt.NDArray[np.int64]
    placements: Array
    axes: Array
    turns: Array
    coupling: Array
    offset: Array


@once_for_each
def _joints_of(model: pin.Model) -> _Joints:
    screw = screws(model)
    turns = np.linalg.norm(screw[:, 3:], axis=1) > 0.5
    A, b = coupling(model)
    return _Joints(
        np.array([int(parent) for parent in model.parents], dtype=np.int64),
        np.array([np.array(M.homogeneous) for M in model.jointPlacements]),
        np.ascontiguousarray(np.where(turns[:, None], screw[:, 3:], screw[:, :3])),
        turns.astype(np.float64),
        np.ascontiguousarray(A, dtype=np.float64),
        np.ascontiguousarray(b, dtype=np.float64),
    )


_searches: "WeakKeyDictionary[MotionTools, PlaneSearch]" = WeakKeyDictionary()
_last: "WeakKeyDictionary[SameBodies, PlaneSearch]" = WeakKeyDictionary()
"""That of the last work space of the same bodies; its obstacles may have stood elsewhere."""


def plane_search(model: CollisionModel, tools: MotionTools) -> PlaneSearch | None:
    """Return the search of a work space, made once; None without the core."""
    if core is None:
        return None
    if tools not in _searches:
        known = _last.get(model.same_bodies)
        found = PlaneSearch(model, tools) if known is None else known.with_obstacles_of(tools)
        _searches[tools] = _last[model.same_bodies] = found
    return _searches[tools]
