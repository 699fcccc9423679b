"""The fastest stop: each joint brakes as hard as it can, off the path, where that is proved clear; and the way back."""

from typing import TYPE_CHECKING

import numpy as np

from optiplan._core import core
from optiplan.arrays import Array
from optiplan.collision.native_model import NativeCollisionModel
from optiplan.control.braking import stop_phases
from optiplan.execution.paths.path_laws import Load, PathLaws, SetPoint
from optiplan.execution.paths.proved_path import PathStretch, ProvedPath, Turned
from optiplan.execution.scene.seen_scene import SeenScene
from optiplan.geometry.coal_queries import DISTANCE_ERROR
from optiplan.problem.task.scene_part import ScenePart
from optiplan.robot.robot import Limits
from optiplan.trajectory.tolerances import LIMIT_ROUNDING
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.report import VerifyPolicy

if TYPE_CHECKING:
    from optiplan._core._core_base import TimeLaw

SHARES = (1.0, 0.7, 0.5)
"""Of the limits of acceleration that stops are tried with: torques may not allow all of it."""

ENDS_TOGETHER = 1e-11
"""s; phases of joints that end so close to each other end together. Accelerations may step by twice that times jerk."""

SWEEP = np.array([0.1, 2.0 * DISTANCE_ERROR, 1e-6, 12.0])
"""rad or m, m, s, parts: see `SweepRules` of the core."""


class Detour:
    """A stop off the path, and the way back to where it left it.

    Attributes:
        stop: from the path to rest.
        law: of the stop.
        back: the same way in the other direction; its end is on the path.
        left: the stretch of the path that was left, at `s` of its laws.
    """

    def __init__(self, stop: PathStretch, law: "TimeLaw", left: PathStretch, s: float) -> None:
        self.stop, self.law, self.left, self.s = stop, law, left, s
        self.back = PathStretch(stop.laws.mirrored(rests=False), stop.start, 0.0, stop.model)
        self._legs: list[Turned] = []

    def steer(self, stretch: PathStretch, law: "TimeLaw", time: float, speed: float, seen: SeenScene) -> Turned:
        """Return the stretch and law that follow those of the detour, to the path and on at a speed; 0.0: stay.

        The stop is not changed; on the way back the robot may stop. What follows a law is found before it ends.
        """
        if law.settled > time:
            legs = self._onward(stretch, law, law.settled, speed)
            self._legs = [leg._replace(clear=seen.blocked(leg.stretch, leg.law, leg.begin) is None) for leg in legs]
            keeps = speed > 0.0 or stretch is self.stop
            stop = None if keeps else stretch.laws.change_along(law, time, 0.0)
            return Turned(stretch, law if stop is None else stop)
        if speed == 0.0:
            return Turned(stretch, law)
        if not self._legs or self._legs[0].begin != law.settled:
            self._legs = self._onward(stretch, law, time, speed)
        return self._legs.pop(0) if self._legs else Turned(stretch, law)

    def forget(self) -> None:
        """Let what follows be checked again: obstacles have moved."""
        self._legs = [leg._replace(clear=False) for leg in self._legs]

    def drop(self) -> None:
        """Let what follows be found again: the present law has ended a while ago."""
        self._legs = []

    def _onward(self, stretch: PathStretch, law: "TimeLaw", then: float, speed: float) -> list[Turned]:
        """Return what follows a law that ends at `then`, s: the way back, and the path."""
        s, legs = law.at(then)[0], list[Turned]()
        if speed == 0.0:
            return legs
        if stretch is self.stop or s < stretch.laws.length:
            onward = self.back.laws.rest_to_rest(s if stretch is self.back else 0.0, then)
            if onward is None:
                return legs
            legs.append(Turned(self.back, onward))
            then = onward.settled
        rest = self.left.laws.steady(self.s, 0.0, then)
        return [*legs, Turned(self.left, self.left.laws.change_along(rest, then, speed) or rest)]


class JointStops:
    """Stops off a path.

    The motion of all joints is known as polynomials. It is proved free of contacts by the native core, and to keep the
    limits of positions, velocities and torques, and the clearance of `SceneWatch` from all obstacles, where they stand
    in the run and where they were seen.

    Args:
        path: with the robot and what it holds.
    """

    def __init__(self, path: ProvedPath) -> None:
        self._path = path
        self._models: dict[int, NativeCollisionModel] = {}

    def prepare(self) -> None:
        """Make the scenes of all parts of the path, which takes milliseconds."""
        for k in range(len(self._path.parts)):
            self._model(k)

    def leave(self, stretch: PathStretch, law: "TimeLaw", time: float, seen: SeenScene) -> Detour | None:
        """Return the fastest stop from where a law is; None where none is proved that is faster than that law's.

        Nor is there one where a path constraint holds, which the robot might violate beside the path, or where the run
        was proved for a tracking error, for which no stop beside the path is.
        """
        if self._path.constrained or self._path.run.problem.tracking_error.any():
            return None
        point = stretch.laws.set_point(law, time)
        place, limits = stretch.place(point.place.s), self._path.run.problem.limits
        k, within = self._path.part_at(place), law.settled - time if law.target == 0.0 else np.inf
        for share in SHARES:
            motion = quickest_stop(point, limits, share, self._path.motion.joint_names)
            if motion is None or motion.duration >= within or not within_limits(motion, limits):
                return None
            part = self._path.parts[k]
            laws = PathLaws(motion, limits, [Load(0.0, motion.duration, part.problem.robot)])
            if laws.keeps_torque and laws.overloaded is None:
                break
        else:
            return None
        model = self._model(k)
        if not _is_clear(model, motion):
            return None
        off, T = PathStretch(laws, place, 0.0, model), motion.duration
        stop = laws.steady(0.0, 1.0, time).then(laws.steady(T, 0.0, time + T))
        if seen.blocked(off, stop, time, known=True) is not None:
            return None
        return Detour(off, stop, stretch, point.place.s)

    def _model(self, k: int) -> NativeCollisionModel:
        if k not in self._models:
            part: ScenePart = self._path.parts[k]
            self._models[k] = NativeCollisionModel(part.problem.robot, part.problem.scene)
        return self._models[k]


def _is_clear(model: NativeCollisionModel, motion: Trajectory) -> bool:
    if model.world is None:
        return False
    sweep = core.Sweep(model.world, motion.breakpoints, motion.coefficients, SWEEP)
    return not sweep.prove(0, sweep.intervals)


def quickest_stop(point: SetPoint, limits: Limits, share: float, names: tuple[str, ...]) -> Trajectory | None:
    """Return the motion in which each joint brakes with a share of its acceleration; None where it stands still.

    See `control.braking` for the phases of a joint.

    Holds at: all times, for acceleration and jerk.
    """
    most, here = limits.acceleration * share, np.abs(point.a)
    if not np.isfinite(most).all() or (here > most * (1.0 + VerifyPolicy.limit_tolerance + LIMIT_ROUNDING)).any():
        return None
    most = np.maximum(most, here)
    begin, first, jerk = np.zeros((3, len(point.q), 4))
    for j, (v, a) in enumerate(zip(point.v.tolist(), point.a.tolist(), strict=True)):
        t, k = 0.0, -1
        for k, (lasting, at, change) in enumerate(stop_phases(v, a, float(most[j]), float(limits.jerk[j]))):
            begin[j, k], first[j, k], jerk[j, k] = t, at, change
            t += lasting
        begin[j, k + 1 :] = t  # at rest
    return _together(point, begin, first, jerk, names)


def _together(point: SetPoint, begin: Array, first: Array, jerk: Array, names: tuple[str, ...]) -> Trajectory | None:
    """Join the phases of all joints, (n, 4) each, the last at rest: begin, s, acceleration there, and jerk."""
    h = np.diff(begin, axis=1)
    v, q = np.zeros((2, *begin.shape))
    v[:, 0], q[:, 0] = point.v, point.q
    for k in range(3):
        v[:, k + 1] = v[:, k] + h[:, k] * (first[:, k] + 0.5 * h[:, k] * jerk[:, k])
        q[:, k + 1] = q[:, k] + h[:, k] * (v[:, k] + h[:, k] * (0.5 * first[:, k] + h[:, k] * jerk[:, k] / 6.0))
    v[:, 3] = 0.0
    times = np.unique(begin)
    times = times[np.concatenate([[True], np.diff(times) > ENDS_TOGETHER])]
    if len(times) < 2:
        return None
    middle = 0.5 * (times[1:] + times[:-1])
    phase = (begin[:, :, None] <= middle).sum(axis=1) - 1  # (n, m)
    rows = np.arange(len(phase))[:, None]
    t, a, j = times[:-1] - begin[rows, phase], first[rows, phase], jerk[rows, phase]
    at_q = q[rows, phase] + t * (v[rows, phase] + t * (0.5 * a + t * j / 6.0))
    coefficients = np.array([at_q, v[rows, phase] + t * (a + 0.5 * t * j), 0.5 * (a + t * j), j / 6.0])
    return Trajectory(names, times, np.ascontiguousarray(coefficients.transpose(2, 0, 1)))


def within_limits(motion: Trajectory, limits: Limits) -> bool:
    """Whether cubics keep the limits of positions, by the hull of their control points, and of velocities."""
    h, (q, v, a, j) = motion.widths[:, None], motion.coefficients.swapaxes(0, 1) * [[[1.0]], [[1.0]], [[2.0]], [[6.0]]]
    with np.errstate(divide="ignore", invalid="ignore"):
        turn = -a / j
        turn = np.where((turn > 0.0) & (turn < h), turn, 0.0)
    speed = np.abs([v, v + h * (a + 0.5 * h * j), v + turn * (a + 0.5 * turn * j)])
    hull = q + np.array(
        [0.0 * v, h * v / 3.0, h * (2.0 * v / 3.0 + h * a / 6.0), h * (v + h * (0.5 * a + h * j / 6.0))]
    )
    most = limits.velocity * (1.0 + VerifyPolicy.limit_tolerance)
    return bool(not limits.outside(hull).any() and (speed <= most).all())
