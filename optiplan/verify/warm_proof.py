"""Proof of short motions in the native core: everything that depends on robot and scene alone is prepared once.

`verify` proves with coal and takes tens of milliseconds; this proof takes a fraction of one, and covers fewer problems.
It bounds motions, distances and torques by code of its own. In common are which pairs are checked, what is kept of
neighbours, and which bodies stand in others. Its tests compare the verdicts: `verify` accepted all that is proved here.
"""

from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

import coal
import numpy as np
import pinocchio as pin

from optiplan._core import core
from optiplan.arrays import Array
from optiplan.collision.bodies_and_pairs import overlapping
from optiplan.collision.geometry_model import geometry_of
from optiplan.collision.native_model import NativeCollisionModel
from optiplan.errors import OptiPlanError
from optiplan.problem.problem import Problem
from optiplan.records import dataclass
from optiplan.robot.limits import ORDERS
from optiplan.robot.mimic_joints import unfold
from optiplan.robot.self_collision.pair_bounds import LocalBox
from optiplan.verify.collision_check import checked_robot
from optiplan.verify.continuous.kept_clearance import KeptClearance, kept_clearances
from optiplan.verify.report import VerifyPolicy
from optiplan.verify.tolerances import LARGEST

if TYPE_CHECKING:
    from optiplan._core._core_base import NearestChunk

SHARE = 0.5
"""Of the verifier's tolerances that this proof uses: the rest is for the difference in rounding."""

CONTINUITY = 1e-10
"""rad or m: sum of steps of position at breakpoints; the bodies move by less than the proof's own rounding, 1e-9 m."""

MOST_JOINTS, MOST_DEGREE = 64, 15
"""Planned joints, and degree of polynomials, that the core's buffers hold."""


class Polynomials(NamedTuple):
    """A motion as from the core: breakpoints (m + 1,), s, and coefficients (m, degree + 1, n) as of `Trajectory`."""

    breakpoints: Array
    coefficients: Array


@dataclass(frozen=True)
class MotionVerdict:
    """What the proof of a motion found.

    Attributes:
        reason: why it is not proved; empty where it is.
        time: everything before it is proved to keep what `reason` is about, s.
        torque: whether a torque is the reason.
        clearance: proved of all pairs of the robot's own bodies, and of those with an obstacle, m; inf without any.
    """

    reason: str = ""
    time: float = 0.0
    torque: bool = False
    clearance: tuple[float, float] = (np.inf, np.inf)

    @property
    def proved(self) -> bool:
        """Whether the motion is proved."""
        return not self.reason


class WarmProof:
    """Prove motions of the robot of a problem among obstacles that stand still.

    A motion is proved to begin in a state, to keep the limits of position, velocity, acceleration, jerk and torque, to
    touch nothing, neither itself nor an obstacle, to keep a clearance from obstacles, and to end at rest.

    Limits: Bernstein coefficients of each polynomial piece. Torques: values and a bound on their second derivative.
    Distances: on an interval of time with a plane between two bodies, the gap along its normal in the middle, by
    support functions, less what the bodies can move; intervals where that is not enough are divided. The normals come
    from the core's search for distances, and need not be accurate. Non-convex meshes whose hulls meet: the core's
    distance less 2e-6 m.

    Holds at: all times of the closed interval [0, duration], rounding included.

    Args:
        problem: gives robot, scene and limits; its goal and its task are not looked at.

    Raises:
        OptiPlanError: the core is missing or does not know the shape of a body.
    """

    def __init__(self, problem: Problem) -> None:
        if core is None:
            raise OptiPlanError("op.certify needs the native core of optiplan, which is not built: make core")
        robot = checked_robot(problem, VerifyPolicy())
        self._model = model = NativeCollisionModel(robot, problem.scene)
        if model.world is None:
            raise OptiPlanError(f"the native core does not know the shape of {', '.join(model.unknown)}")
        self._robot, self._limits = robot, problem.limits
        first = len(model.names) - len(problem.scene.obstacles)
        self._obstacles = {obstacle.name: first + k for k, obstacle in enumerate(problem.scene.obstacles)}
        self._moved: dict[str, Array] = {}
        self._sunk = ""
        kinds = np.array([int(max(pair.a, pair.b) >= first) for pair in model.pairs], dtype=np.int64)
        kept = kept_clearances(robot)
        tables = [_table(pair.index, kept[pair.a, pair.b]) for pair in model.pairs if (pair.a, pair.b) in kept]
        plain = unfold(robot.model)
        armature = (plain.A**2).T @ np.array(plain.model.armature)  # a follower's turns with its multiplier
        self._core = core.MotionProof.of(model.world, kinds, tables, _rows(problem), armature)

    def scope(self, clearance: float) -> tuple[str, ...]:
        """Return what a proof with a clearance from obstacles, m, is about, in short statements."""
        limits = ["position", *(name for name in (*ORDERS[1:], "torque") if self._limited(name))]
        meshes = any(isinstance(body.geometry, coal.BVHModelBase) for body in self._model.geometry.geometryObjects)
        beyond = f", those with an obstacle by more than {1e3 * clearance:g} mm" if clearance else ""
        trust = "; of non-convex meshes whose hulls meet, as measured less 2e-6 m" if meshes else ""
        return (
            f"limits of {', '.join(limits)}, at all times",
            f"{len(self._model.pairs)} pairs of bodies stay apart{beyond}, at all times",
            f"distances: gaps between separating planes, by support functions in the native core{trust}",
            "obstacles stand still where the problem and `poses` have them",
        )

    def _limited(self, name: str) -> bool:
        return bool(np.isfinite(getattr(self._limits, name)).any())

    @property
    def obstacles(self) -> tuple[str, ...]:
        """Names of the obstacles that can be placed."""
        return tuple(self._obstacles)

    def place(self, poses: Mapping[str, pin.SE3]) -> None:
        """Put obstacles at poses in the world; those not named stand where the problem has them."""
        wanted = {name: np.ascontiguousarray(X.homogeneous) for name, X in poses.items()}
        changed = [
            name for name in wanted if name not in self._moved or not np.array_equal(wanted[name], self._moved[name])
        ]
        back = [name for name in self._moved if name not in wanted]
        for name in changed:
            self._core.move(self._obstacles[name], wanted[name])
        for name in back:
            home = self._model.geometry.geometryObjects[self._obstacles[name]].placement
            self._core.move(self._obstacles[name], np.ascontiguousarray(home.homogeneous))
        self._moved = wanted
        if changed or back:
            self._sunk = self._standing_in()

    def _standing_in(self) -> str:
        """Return which moved obstacle stands in a link that never moves, or nothing: such pairs are no others."""
        bodies, bounds = self._model.geometry.geometryObjects, self._model.bounds
        where = {self._obstacles[name]: X for name, X in self._moved.items()}
        pairs = np.array([pair for pair in self._model.standing_pairs.tolist() if pair[1] in where], dtype=np.intp)
        if not len(pairs):
            return ""
        used, local = np.unique(pairs, return_inverse=True)
        placed = []
        for body in used.tolist():
            copy = bodies[body].copy()
            if body in where:
                copy.placement = pin.SE3(where[body])
            placed.append(copy)
        boxes = [LocalBox(bounds.centre[k], bounds.half[k], float(bounds.radius[k])) for k in used.tolist()]
        found = overlapping(geometry_of(placed), local.reshape(-1, 2), boxes)
        if not found:
            return ""
        a, b = (self._model.names[used[k]] for k in found[0])
        return f"'{b}' stands in '{a}'"

    def prove(self, motion: Polynomials, state: Array, clearance: float = 0.0) -> MotionVerdict:
        """Prove a motion.

        Args:
            motion: of degree 15 at most.
            state: in which it begins (3, n): position, velocity and acceleration, rad or m and s.
            clearance: from obstacles, m, >= 0.
        """
        b, c = motion
        if self._sunk:
            return MotionVerdict(self._sunk)
        kinematics = self._robot.kinematics
        if kinematics.follows and not kinematics.joint_reach(np.abs(c[:, 0]).max(axis=0)).max() <= LARGEST:
            return MotionVerdict(f"joints that follow others would be beyond {LARGEST:g} rad or m, with no digits left")
        order, joint, time, value, limit = self._core.limits(b, c, state)
        if order >= 0:
            return MotionVerdict(self._beyond(order, joint, time, value, limit), time)
        inside = self._inside(state[0])
        if inside:
            return MotionVerdict(inside)
        pair, time, distance, touches, own, scene, _, _ = self._core.apart(b, c, clearance)
        if pair >= 0:
            return MotionVerdict(self._near(pair, time, distance, touches), time)
        joint, time, value = self._core.torques(b, c)
        if joint >= 0:
            limit = float(self._limits.torque[joint])
            name, unit = self._robot.joint_names[joint], self._robot.unit("torque", joint)
            found = f"'{name}' needs {value:.4g} {unit} at {time:.3f} s; its limit of torque is {limit:.4g} {unit}"
            if value <= limit:
                found = f"the torque of '{name}' is not proved from {time:.3f} s on"
            return MotionVerdict(found, time, torque=True)
        return MotionVerdict(clearance=(own, scene))

    def nearest(
        self, state: Array, Q: Array, times: Array, rests: bool, limits: Array, radius: float
    ) -> "NearestChunk":
        """Return the search for the nearest chunk among the same bodies; nothing of it is proved."""
        return core.NearestChunk.of(self._core, state, Q, times, rests, limits, radius)

    def _inside(self, q: Array) -> str:
        """Return which body is inside another, a mesh, or nothing: surfaces that stay apart do not tell."""
        containment = self._model.containment
        if not containment.possible:
            return ""
        joints, placements = self._model.bounds.joint, self._model.bounds.placement.copy()
        for name, X in self._moved.items():
            placements[self._obstacles[name]] = X
        found = containment.find(self._model.kinematics.poses(self._model.full(q[None]))[0][joints] @ placements)
        return (
            "" if found is None else f"'{self._model.names[found.inner]}' is inside '{self._model.names[found.mesh]}'"
        )

    def _beyond(self, order: int, joint: int, time: float, value: float, limit: float) -> str:
        name = self._robot.joint_names[joint]
        if order == 12:
            return (
                f"large terms of the motion of '{name}' cancel at {time:.3f} s: their sum is known to {value:.2g} only"
            )
        kind = ORDERS[order if order < 4 else order - 4 if order < 7 else order - 7 if order < 10 else order - 9]
        unit = self._robot.unit(kind, joint)
        if order == 0:
            return f"'{name}' would be at {value:.4f} {unit} at {time:.3f} s; its limit is {limit:.4f} {unit}"
        if order < 4:
            return (
                f"{kind} of '{name}' would be {value:.4g} {unit} at {time:.3f} s; its limit is {abs(limit):.4g} {unit}"
            )
        if order < 7:
            return f"{kind} of '{name}' steps by {value:.3g} {unit} at {time:.3f} s"
        where = "begins off the robot's own" if order < 10 else "ends with a"
        return f"the motion {where} {kind} of '{name}' by {value:.3g} {unit}"

    def _near(self, pair: int, time: float, distance: float, touches: bool) -> str:
        names = f"'{self._model.pairs[pair].name_a}' and '{self._model.pairs[pair].name_b}'"
        if not touches:
            return f"{names} are not proved apart at {time:.3f} s"
        if distance <= 0.0:
            return f"{names} would touch at {time:.3f} s"
        return f"{names} would be {1e3 * distance:.3g} mm apart at {time:.3f} s"


def _table(pair: int, kept: KeptClearance) -> tuple[int, list[int], list[bool], Array]:
    """What is kept of a pair for the core: its joints, which are endless, and rows of middles, halves, clearance."""
    rows = np.ascontiguousarray(np.column_stack([kept.middle, kept.half, kept.clearance]))
    return pair, kept.joints.tolist(), kept.endless.tolist(), rows


def _rows(problem: Problem) -> Array:
    """Limits (9, n) with `SHARE` of the verifier's tolerances: five of motion, torque, and sums of steps of three."""
    limits, policy = problem.limits, VerifyPolicy()
    more, spare, rest = (
        1.0 + SHARE * policy.limit_tolerance,
        SHARE * policy.position_tolerance,
        SHARE * policy.rest_tolerance,
    )
    rows = [limits.lower - spare, limits.upper + spare, *(more * rate for rate in limits.rates)]
    masses = any(body.mass > 0.0 for body in problem.robot.model.inertias)
    rows.append(more * limits.torque if masses else np.full(problem.robot.n, np.inf))
    free = np.where(np.isinf(limits.jerk), np.inf, rest * limits.acceleration)
    return np.ascontiguousarray([*rows, np.full(problem.robot.n, CONTINUITY), rest * limits.velocity, free])
