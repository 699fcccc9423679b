"""`ClearanceLimit`: bodies of the robot, of what it holds and of the scene stay apart."""

from collections.abc import Mapping
from dataclasses import replace
from typing import ClassVar

import numpy as np
import pinocchio as pin

from optiplan._core import core
from optiplan.arrays import Array, Index, cross
from optiplan.collision.native_model import NativeCollisionModel, planning_model
from optiplan.control.arguments import checked_number
from optiplan.control.braking_path import NativeBrakingPath
from optiplan.control.configuration import Configuration
from optiplan.control.limits.moving_obstacles import AHEAD, HORIZON, ObstacleJoints, PathAmongMoving, straight_on
from optiplan.control.limits.stop_limits import KEPT, DistanceView, StopLimit, StopPath
from optiplan.errors import described, wrong_argument
from optiplan.geometry.scene import Scene
from optiplan.robot.batched.kinematics import inverse_poses
from optiplan.robot.robot import Robot

AT_LEAST = 0.005
"""m; kept where no other distance is given: what planners aim at."""
SAMPLES = 48
"""Configurations in which a pair is looked at before it is taken for one that its structure keeps near."""
EVERY = 0.01
"""s between the moments at which it is asked what braking would come to among moving obstacles."""


class ClearanceLimit(StopLimit):
    """Distances of all pairs that a problem would check: links, attached objects, obstacles; see `StopLimit`.

    Distances are measured only of pairs that the travel since their last query may have brought near: in the native
    core, or by coal where that is not there or does not know a shape.

    Attributes:
        structure: m, by the names of pairs that never come as far apart as `at_least`, since they are neighbours: what
            of them is kept instead.

    Args:
        scene: obstacles, attached objects, allowed contacts; None: the robot alone.
        at_least: m.
        influence: m; pairs farther apart are no rows.
        rate: 1/s; how quickly a distance may shrink, as a share of itself: rate · influence should be no less than the
            largest speed of the robot's bodies, or they brake hard when they come into view.

    Raises:
        InputError: a distance that is not > 0, no scene; an obstacle that turns; when it is bound, a pair that touches
            in every configuration.
    """

    name: ClassVar[str] = "clearance"

    def __init__(
        self, scene: Scene | None = None, at_least: float = AT_LEAST, influence: float = 0.05, rate: float = 50.0
    ) -> None:
        if scene is not None and not isinstance(scene, Scene):
            raise wrong_argument("ClearanceLimit", "scene", described(scene), "an op.Scene")
        self.scene = Scene() if scene is None else scene
        for body in self.scene.turning_obstacles:
            raise wrong_argument("ClearanceLimit", "scene", f"'{body.name}', which turns", "obstacles that slide")
        self._passed: dict[str, float] = {}
        self.at_least = checked_number(self, "at_least", at_least, 0.0)
        self.influence = self.at_least + checked_number(self, "influence", influence, 1e-4)
        self.rate = checked_number(self, "rate", rate, 1e-3)

    def bind(self, robot: Robot) -> None:
        """Make the bodies, and bounds of how far joints move them."""
        self._passed.clear()
        self._make(robot)

    def _make(self, robot: Robot) -> None:
        super().bind(robot)
        self.model = planning_model(
            robot, replace(self.scene, safety=None), passing=True
        )  # it has a distance of its own
        bounds = self.model.bounds
        self._obstacles = ObstacleJoints(self.model.motions)
        self.arms = bounds.moment_arms(np.append(robot.limits.stroke, np.zeros(self._obstacles.size)))
        self.labels = tuple(f"{pair.name_a} and {pair.name_b}" for pair in self.model.pairs)
        self.require_least()
        self.structure = self._structure(robot)
        self._let_pass()
        self._follows = bool(robot.followers)
        self._leaders = np.abs(bounds.kinematics.coupling) > 0.0  # columns of followers have their multiplier already
        self._joints = bounds.joint[bounds.pairs]
        first, second = bounds.kinematics.carries[self._joints].swapaxes(0, 1)  # (P, J) each
        self._common = ((first & second) * np.arange(1, first.shape[1] + 1)).max(axis=1, initial=0)
        self._reaches = np.where(self._joints > 0, bounds.body_reaches()[bounds.pairs], 0.0)
        self.still = not self.model.motions
        self._dynamic: dict[str, tuple[int, pin.SE3]] = {}
        if not self.still:
            self._among_moving(robot)
        self._watch = None
        if isinstance(self.model, NativeCollisionModel) and self.model.world is not None:
            arms, reaches = np.ascontiguousarray(self.arms), np.ascontiguousarray(self._reaches)
            effects = np.array([self.turns, self.slides])
            given = arms, reaches.reshape(-1, 2), effects, self.comes_in, KEPT
            self._watch = core.ClearanceWatch(self.model.world, *given)
        self.in_core = self._watch is not None

    def _structure(self, robot: Robot) -> dict[str, float]:
        """Ask no more of a pair than its bodies' places on the robot allow; see `structure`.

        Of a pair that is nearer than `at_least` in all of SAMPLES configurations half the largest distance is kept. It
        is watched like all others, however alike its distances are: between the samples it may come nearer.

        Raises:
            InputError: a pair that touches in all of them.
        """
        lower, upper = np.maximum(robot.limits.lower, -np.pi), np.minimum(robot.limits.upper, np.pi)
        # The golden ratio's sequence in n dimensions: even, and the same each time.
        ratio = float(np.roots([1.0, *[0.0] * (robot.n - 1), -1.0, -1.0]).real.max())
        shares = np.outer(np.arange(1, SAMPLES + 1), ratio ** -np.arange(1.0, robot.n + 1)) % 1.0
        found = self.model.near(lower + shares * (upper - lower), self.at_least)
        by_itself = self.arms[:, robot.n :].sum(axis=1) > 0.0
        near = np.bincount(found.pairs, minlength=len(self.labels)).tolist()
        structure = {}
        for k in [k for k, count in enumerate(near) if count == SAMPLES and not by_itself[k]]:
            most = float(found.distance[found.pairs == k].max())
            if most <= 0.0:
                a, b = self.bodies(k)
                touch = f"'{a}' and '{b}' that touch in every configuration of {robot.name}"
                raise wrong_argument(
                    "ClearanceLimit", "scene", touch, "bodies that can be apart, or an allowed contact"
                )
            self.least[k], self.margin[k] = 0.5 * most, 0.6 * most
            structure[self.labels[k]] = 0.5 * most
        return structure

    def _among_moving(self, robot: Robot) -> None:
        """Take the joints of moving obstacles behind those of the robot."""
        none, slide = np.zeros(self._obstacles.size), np.ones(self._obstacles.size)
        self.turns, self.slides = np.append(self.turns, none), np.append(self.slides, slide)
        self._placed = Configuration(robot, self.model.model)
        self.moving = np.asarray(self.arms[:, robot.n :].sum(axis=1) > 0.0)
        self.comes_in = self.comes_in + AHEAD * self.moving
        self._dynamic = {body.name: (k, body.X_WO) for k, body in enumerate(self.scene.dynamic_obstacles)}

    def see(self, poses: Mapping[str, pin.SE3], velocities: Mapping[str, Array], t: float) -> bool:
        """Take the poses X_WO of obstacles of the scene at time t, s, and their velocities (3,), m/s.

        They go on with these for HORIZON, and stand still then. Obstacles that have not moved before are made anew.

        Returns:
            Whether what was measured before tells nothing any more.
        """
        if not poses:
            return False
        turned = [name for name, X_WO in poses.items() if not self._has_turn(name, X_WO)]
        if self.still or not poses.keys() <= self._dynamic.keys() or (turned and self._watch is None):
            self._make_anew(poses, velocities, t)
            return True
        for name, X_WO in poses.items():
            k, placed = self._dynamic[name]
            self._obstacles.replace(k, straight_on(X_WO.translation - placed.translation, velocities[name], t))
        for name in turned:
            k, placed = self._dynamic[name]
            self._dynamic[name] = k, pin.SE3(poses[name].rotation, placed.translation)
            assert isinstance(self.model, NativeCollisionModel)
            assert self.model.world is not None
            self.model.world.move_body(self.model.names.index(name), self._dynamic[name][1].homogeneous)
        return bool(turned)

    def pass_along(self, Q: Array, t: Array) -> None:
        """Require of pairs that are near on a motion, Q (N, n) at times t (N,), s, half of their least distance there.

        This lasts, also where obstacles are placed anew. Pairs of an obstacle that the motion touches, or that moves
        meanwhile, keep their distance: the motion was not proved for these.
        """
        n, Q = Q.shape[1], self._among_obstacles(Q, t)
        found, least = self.model.near(Q, 2.0 * self.at_least), np.full(len(self.labels), np.inf)
        np.minimum.at(least, found.pairs, found.distance)
        second = self.model.bounds.pairs[:, 1]  # obstacles come last
        touched = np.isin(second, second[least <= 0.0])
        least[touched | (self.arms[:, n:] @ np.ptp(Q[:, n:], axis=0) > 0.0)] = np.inf
        for k in np.flatnonzero(np.isfinite(least)).tolist():
            self._passed[self.labels[k]] = min(float(least[k]), self._passed.get(self.labels[k], np.inf))
        self._let_pass()

    def _let_pass(self) -> None:
        """Require no more of pairs than followed motions leave them."""
        least = np.array([self._passed.get(label, np.inf) for label in self.labels])
        self.least, self.margin = np.minimum(self.least, 0.5 * least), np.minimum(self.margin, 0.6 * least)

    def _among_obstacles(self, Q: Array, t: Array) -> Array:
        """Q (N, n) with the obstacles where they are expected at times t (N,), s: (N, n + K)."""
        return np.hstack([Q, self._obstacles.at(t)])

    def _has_turn(self, name: str, X_WO: pin.SE3) -> bool:
        return name in self._dynamic and np.array_equal(self._dynamic[name][1].rotation, X_WO.rotation)

    def _make_anew(self, poses: Mapping[str, pin.SE3], velocities: Mapping[str, Array], t: float) -> None:
        """Make the model with these obstacles among those that move; others go on as they did."""
        moving = {
            body.name: replace(body, X_WO=self._dynamic[body.name][1], motion=motion)
            for body, motion in zip(self.scene.dynamic_obstacles, self._obstacles.motions, strict=True)
        }
        for body in self.scene.obstacles:
            if body.name in poses:
                motion = straight_on(np.zeros(3), velocities[body.name], t)
                moving[body.name] = replace(body, X_WO=poses[body.name], motion=motion)
        self.scene = self.scene.with_(*moving.values())
        self._make(self.model.robot)  # followed motions still pass what they passed

    def view(self, c: Configuration, before: DistanceView | None, t: float) -> DistanceView:
        """See `StopLimit.view`."""
        if not self.still:
            q = np.append(c.q, self._obstacles.at(t))
            if self._watch is None:
                self._placed.update(q, np.zeros(len(q)))
                return super().view(self._placed, before, t)
        else:
            q = c.q
        if self._watch is None:
            return super().view(c, before, t)
        return self._watch.look(q, before)

    def drift(self, view: DistanceView, t: float) -> Array:
        """See `StopLimit.drift`: gradients with respect to where obstacles are, times their velocities."""
        size = self._obstacles.size
        return np.asarray(view.gradient[:, -size:] @ self._obstacles.rates(t))

    def is_far(self, start: DistanceView, way: Array, least: Array) -> bool:
        """See `StopLimit.is_far`; what moves by itself is looked at in `stop_is_clear`."""
        return self.still and super().is_far(start, way, least)

    def stop_is_clear(self, path: StopPath, start: DistanceView, least: Array, t: float) -> bool:
        """See `StopLimit.stop_is_clear`; obstacles go on moving, for HORIZON at least."""
        if self._watch is None or not isinstance(path, NativeBrakingPath):
            if not self.still:
                path = PathAmongMoving(path, self._obstacles, t, self._placed)
            return super().stop_is_clear(path, start, least, t)
        native = path.native if self.still else path.native.carrying(*self._obstacles.coefficients(t), HORIZON)
        return self._watch.stop_is_clear(native, start, least)

    def ahead(self, path: StopPath, t: float) -> Array:
        """See `StopLimit.ahead`; every EVERY s for HORIZON."""
        times = np.arange(0.0, HORIZON, EVERY)
        Q = np.array([path.at(min(round(time / path.dt), path.steps)) for time in times])
        found = self.model.near(self._among_obstacles(Q, t + times), self.at_least)
        least, own = np.full(len(times), np.inf), self.moving[found.pairs]
        np.minimum.at(least, found.rows[own], found.distance[own])
        return least

    def bodies(self, k: int) -> tuple[str, str]:
        """See `StopLimit.bodies`."""
        return self.model.pairs[k].name_a, self.model.pairs[k].name_b

    def distances(self, c: Configuration, which: Index) -> Array:
        """Distances, m, negative where bodies overlap; meshes that overlap are measured by their hulls."""
        return np.asarray(self.model.distances_at(c.data, which))

    def gradients(self, c: Configuration, which: Index) -> Array:
        """N . (J_b - J_a) of the witness points: with spatial J, (J_v + J_w × p) · n = J · (n, p × n)."""
        vectors, J = self.model.witnesses(), c.joint_jacobians()
        normals, moves = vectors[:, 2], self.model.bounds.moves[which]
        forces = np.empty((2, len(which), 6))
        forces[:, :, :3] = normals
        forces[0, :, 3:], forces[1, :, 3:] = cross(vectors[:, 0], normals), cross(vectors[:, 1], normals)
        sides = (forces @ J) * moves.transpose(1, 0, 2)
        change = sides[1] - sides[0]
        return np.asarray(change @ self._leaders if self._follows else change)

    def mark(self, c: Configuration) -> Array:
        """Homogeneous poses (J + 1, 4, 4) of all joints."""
        return np.array([X.homogeneous for X in c.data.oMi])

    def chords(self, first: Array, second: Array, which: Index) -> Array:
        """|p' - p| + |R' - R|_F / √2 · (reach of the body from its joint), for both bodies: chords of all their points.

        A turn by an angle t has |R' - R|_F = √8 sin(t / 2), and moves a point at distance r by up to 2 r sin(t / 2).
        Poses are those against the joint that carries both bodies.
        """
        joints, common = self._joints[which], self._common[which]
        X, Y = (inverse_poses(mark[common])[:, None] @ mark[joints] for mark in (first, second))
        change = (Y - X) ** 2
        shift = np.sqrt(change[:, :, :3, 3].sum(axis=2))
        turn = np.sqrt(0.5 * change[:, :, :3, :3].sum(axis=(2, 3)))
        return np.asarray((shift + turn * self._reaches[which]).sum(axis=1))
