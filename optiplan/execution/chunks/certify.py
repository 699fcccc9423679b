"""`certify`: a chunk of set-points of a learned policy becomes a motion that is proved until the robot stands still."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
import pinocchio as pin

from optiplan._core import core
from optiplan.arrays import Array, Flags, is_finite
from optiplan.errors import OptiPlanError, described, wrong_argument
from optiplan.execution.arguments import numbers, told
from optiplan.execution.chunks.chunk import Chunk, Outcome
from optiplan.geometry.pose import Pose
from optiplan.problem.problem import Problem
from optiplan.trajectory.state import State
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.warm_proof import MOST_JOINTS, MotionVerdict, Polynomials, WarmProof

INTERPOLATION = (
    "cubic spline through the set-points at their times, with continuous acceleration; it begins in the robot's state, "
    "with one more knot in the middle of the first interval; then every joint stops as fast as its limits allow"
)

MOST_SET_POINTS = 1000
"""In one chunk."""

SAME = 1e-9
"""rad or m, or s: set-points or times that are no farther apart are one."""

AT_REST = 1e-10
"""rad or m per s and s²: a joint that is no faster stands still."""

HUGE = 1e5
"""rad or m: set-points beyond are numbers gone wrong."""

DISTANCES = (1e-3, 2e-3, 4e-3)
"""m, beyond the clearance: what the nearest chunk keeps between samples, tried in this order."""

WINDOW, WIDTH = 0.02, 0.02
"""Pairs nearer than this, m, in the middles of parts of the motion no longer than this, s, are kept apart."""

GENTLER = 0.7
"""Share of the limits of acceleration for the nearest chunk, where torques are the reason, and for a stop."""

STANDSTILL = 0.1
"""s: the stop of a robot that stands."""


class _Prepared(NamedTuple):
    """What is kept of a problem: the proof, and limits (5, n) of position, velocity, acceleration and jerk."""

    proof: WarmProof
    limits: Array


_kept: WeakKeyDictionary[Problem, dict[float, _Prepared]] = WeakKeyDictionary()


def certify(
    problem: Problem,
    q: object,
    t: object = None,
    *,
    start: State | Trajectory | None = None,
    poses: Mapping[str, Pose] | None = None,
    clearance: float = 0.0,
) -> Chunk:
    """Prove a chunk of set-points, or the nearest chunk that can be proved, or a stop; never send what is not proved.

    The motion is the cubic spline with continuous acceleration through the set-points at their times, from the state of
    the robot, and after the last one the stop of every joint within its limits. So it ends at rest, and the robot may
    follow it to its end if the next chunk comes late or never. Without times the set-points are passed as fast as the
    limits admit, and the robot comes to rest at the last one.

    1. That motion is `proved`, if it is.
    2. Else set-points x minimise the sum of |x_i - q_i|^2, in the Euclidean norm over the joints, within the limits and
       with the distances of bodies linearised, up to three times: `nearest`, if that is proved.
    3. Else the robot follows the chunk as far as it is proved, and stops: `stopped`.
    4. Else it is `refused`: keep to the motion of the chunk before, which ends at rest.

    Wrong shapes are errors of the program and raise. Wrong numbers are errors of the policy and end in the proved stop:
    NaN, times that do not rise, set-points out of reach.

    What depends on the problem alone is prepared in the first call with it, which takes much longer.

    Holds at: all times of the motion, rounding included.

    Args:
        problem: robot, scene and limits; its goal and vias are not looked at.
        q: set-points (k, n), rad or m; 1 to 1000 of them.
        t: (k,) s, rising, from 0 at the start of the motion; None: none.
        start: where the robot is: a `State`, or the motion that it would run from now on, to rest, which is then another
            stop that is tried: `chunk.rest(0.1)`. None: the problem's start.
        poses: of obstacles of the scene that stand elsewhere by now, by name.
        clearance: m, to keep from obstacles.

    Returns:
        The outcome with the motion to send.

    Raises:
        InputError: arrays of the wrong shape, unknown obstacles, or a problem with a task, path constraints or obstacles
            that move by the clock, which this proof does not cover.

    Example:
        >>> import numpy as np
        >>> import optiplan as op
        >>> problem = op.load_problem("01_reach")
        >>> ramp = problem.start + np.linspace(0.0, 0.1, 11)[1:, None] ** 2
        >>> op.certify(problem, ramp, 0.05 * np.arange(1, 11))
        Chunk: proved as it is, 10 set-points, 0.500 s
    """
    prepared = _prepared(problem, clearance)
    n = problem.robot.n
    Q, times = _numbers("q", q), None if t is None else _numbers("t", t)
    if Q.ndim != 2 or Q.shape[1] != n or not 1 <= len(Q) <= MOST_SET_POINTS:
        expected = f"(k, {n}): 1 to {MOST_SET_POINTS} set-points of {n} joints"
        raise wrong_argument("certify", "q", f"an array of shape {Q.shape}", expected)
    if times is not None and times.shape != (len(Q),):
        raise wrong_argument("certify", "t", f"an array of shape {times.shape}", f"({len(Q)},): a time a set-point")
    state = _state(problem, start)
    X = _poses(prepared.proof, poses)
    prepared.proof.place(X)
    rest = start if isinstance(start, Trajectory) else None
    return _Certifier(problem, prepared, Q, times, state, rest, X).chunk()


def _prepared(problem: Problem, clearance: float) -> _Prepared:
    """Return what is kept of the problem, made where there is none."""
    if not isinstance(problem, Problem):
        raise wrong_argument("certify", "problem", described(problem), "op.Problem(…) or op.load_problem(…)")
    if not is_finite(clearance) or clearance < 0.0:
        raise wrong_argument("certify", "clearance", described(clearance), "a distance >= 0, m")
    known = _kept.setdefault(problem, {})
    if clearance not in known:
        found = _not_covered(problem)
        if found:
            raise wrong_argument("certify", "problem", found, "one robot among obstacles that stand still")
        try:
            proof = WarmProof(problem, float(clearance))
        except OptiPlanError as error:
            raise OptiPlanError(f"op.certify: {error}") from None
        limits = problem.limits
        known.clear()  # of one clearance at a time
        rows = np.array([limits.lower, limits.upper, *limits.rates])
        known[clearance] = _Prepared(proof, rows)
    return known[clearance]


def _not_covered(problem: Problem) -> str:
    """Return what of the problem the proof does not cover, or nothing."""
    if problem.task:
        return "a problem with a task"
    if problem.path_constraints:
        return f"a problem with the path constraint `{problem.path_constraints[0].KEY}`"
    moving = problem.scene.dynamic_obstacles
    if moving:
        return f"a problem in which '{moving[0].name}' moves by the clock"
    return f"{problem.robot.n} joints" if problem.robot.n > MOST_JOINTS else ""


def _numbers(name: str, values: object) -> Array:
    """Return an argument as an array of its own."""
    if isinstance(values, np.ndarray) and values.dtype == np.float64:
        return np.array(values, order="C")
    found = numbers(values)
    if not found.size:
        raise wrong_argument("certify", name, told(values), "an array of numbers")
    return np.ascontiguousarray(found)


def _state(problem: Problem, start: State | Trajectory | None) -> Array:
    """Return the state (3, n) at which the motion begins."""
    state = problem.start_state if start is None else start
    if isinstance(state, Trajectory):
        if state.joint_names != problem.robot.joint_names:
            raise wrong_argument("certify", "start", "a motion of other joints", "a motion of the problem's robot")
        c = state.coefficients[0]
        rows = [c[k] * math.factorial(k) if k < len(c) else np.zeros(state.n) for k in range(3)]
        return _still(np.array(rows))
    if not isinstance(state, State):
        raise wrong_argument("certify", "start", described(start), "a State or a Trajectory")
    if state.n != problem.robot.n:
        raise wrong_argument("certify", "start", f"a state of {state.n} joints", f"one of {problem.robot.n}")
    return _still(np.array([state.q, state.v, state.a]))


def _still(state: Array) -> Array:
    """Return a state (3, n) without the rounding that a motion at rest has left."""
    state[1:][np.abs(state[1:]) < AT_REST] = 0.0
    return state


def _poses(proof: WarmProof, poses: Mapping[str, Pose] | None) -> dict[str, pin.SE3]:
    """Return the poses of obstacles in the world."""
    if poses is None:
        return {}
    if not isinstance(poses, Mapping) or not all(isinstance(pose, Pose) for pose in poses.values()):
        raise wrong_argument("certify", "poses", told(poses), "poses by name")
    for name in poses:
        if name not in proof.obstacles:
            expected = f"one of: {', '.join(proof.obstacles)}" if proof.obstacles else "a scene with obstacles"
            raise wrong_argument("certify", "poses", f"an obstacle '{name}'", expected)
    return {name: pin.SE3(pose.matrix) for name, pose in poses.items()}


@dataclass(eq=False)
class _Certifier:
    """One call of `certify`."""

    problem: Problem
    prepared: _Prepared
    Q: Array
    given: Array | None
    state: Array
    running: Trajectory | None
    poses: Mapping[str, pin.SE3]
    times: Array = field(default_factory=lambda: np.empty(0))

    def chunk(self) -> Chunk:
        """Prove what can be proved."""
        wrong = self._wrong()
        if wrong:
            return self._stop(wrong)
        used = self._used()
        off = ""
        if self.given is not None:
            self.times = self.given
            if not used[0]:
                joint = int(np.argmax(np.abs(self.Q[0] - self.state[0])))
                far = float(np.abs(self.Q[0] - self.state[0])[joint])
                if far > SAME:
                    name, unit = self.problem.robot.joint_names[joint], self.problem.robot.unit("position", joint)
                    off = f"set-point 0 is at time 0, but '{name}' is {far:.3g} {unit} away from it"
        if not used.any():
            return self._stop(off) if off else self._answer("proved", self._standing(), 0.0, len(self.Q))
        wanted, rests = np.ascontiguousarray(self.Q[used]), self.given is None
        if self.given is None:
            found = core.chunk_times(self.state, wanted, self.prepared.limits)
            if not len(found):
                return self._stop("no times within the limits of the joints were found")
            self.times = np.concatenate([[0.0], found])[np.cumsum(used)]
        times = self.times[used]
        motion = Polynomials(*core.chunk_curve(self.state, wanted, times, rests, self.prepared.limits))
        verdict = self.prepared.proof.prove(motion, self.state)
        if verdict.proved and not off:
            return self._answer("proved", motion, float(times[-1]), len(self.Q), verdict=verdict)
        reason = off or verdict.reason
        return self._nearest(wanted, times, rests, used, reason) or self._stop(reason, motion, verdict)

    def _wrong(self) -> str:
        """Return what is wrong with the numbers, or nothing."""
        bad: Flags = ~(np.abs(self.Q) <= HUGE)
        if bad.any():
            row, joint = (int(k[0]) for k in np.nonzero(bad))
            return f"set-point {row} has {self.Q[row, joint]} for '{self.problem.robot.joint_names[joint]}'"
        if self.given is None:
            return ""
        if not np.isfinite(self.given).all() or self.given[0] < 0.0:
            k = int(np.argmin(np.isfinite(self.given) & (self.given >= 0.0)))
            return f"set-point {k} is at time {self.given[k]} s"
        late = np.flatnonzero(np.diff(self.given) <= SAME)
        if len(late):
            k = int(late[0])
            return (
                f"set-point {k + 1} is at {self.given[k + 1]:.6g} s, not after set-point {k} at {self.given[k]:.6g} s"
            )
        return ""

    def _used(self) -> Flags:
        """Which set-points the spline passes, (k,): not the one at time 0, nor, without times, the same once more."""
        used = np.ones(len(self.Q), dtype=bool)
        if self.given is not None:
            used[0] = self.given[0] > SAME
        else:
            before = np.vstack([self.state[:1], self.Q[:-1]])
            used = np.asarray(np.abs(self.Q - before).max(axis=1) > SAME)
        return used

    def _nearest(self, wanted: Array, times: Array, rests: bool, used: Flags, reason: str) -> Chunk | None:
        """Return the nearest chunk that is proved, or None."""
        proof, limits = self.prepared.proof, self.prepared.limits
        search = proof.nearest(self.state, wanted, times, rests, limits)
        gentle = False
        for distance in DISTANCES:
            found = search.step(distance, proof.clearance, WINDOW, WIDTH)
            if found is None:
                return None
            motion = Polynomials(*found)
            verdict = proof.prove(motion, self.state)
            if verdict.proved:
                moved = np.vstack([self.state[:1], search.set_points()])[np.cumsum(used)]
                change = np.linalg.norm(moved - self.Q, axis=1)
                return self._answer("nearest", motion, float(times[-1]), len(self.Q), reason, verdict, moved, change)
            if verdict.torque and not gentle:
                gentle, limits = True, limits * np.array([1.0, 1.0, 1.0, GENTLER, 1.0])[:, None]
                search = proof.nearest(self.state, wanted, times, rests, limits)
        return None

    def _stop(self, reason: str, motion: Polynomials | None = None, verdict: MotionVerdict | None = None) -> Chunk:
        """Follow the chunk as far as it is proved, and stop; else stop at once."""
        proof, limits = self.prepared.proof, self.prepared.limits
        if motion is not None and verdict is not None:
            for end in self._ends(motion, verdict.time):
                part = motion.breakpoints[: end + 1], motion.coefficients[:end]
                found = Polynomials(*core.with_stop(*map(np.ascontiguousarray, part), limits))
                proved = proof.prove(found, self.state)
                if proved.proved:
                    until = float(motion.breakpoints[end])
                    reached = int((self.times <= until + SAME).sum())
                    return self._answer("stopped", found, until, reached, reason, proved)
        for found in self._stops():
            proved = proof.prove(found, self.state)
            if proved.proved:
                return self._answer("stopped", found, 0.0, 0, reason, proved)
        return self._answer("refused", None, 0.0, 0, f"{reason}; no stop is proved: {proved.reason}")

    def _ends(self, motion: Polynomials, time: float) -> Sequence[int]:
        """Breakpoints at set-points at which a stop may begin, the last first, at growing distances from `time`."""
        last = int(np.searchsorted(motion.breakpoints, time - SAME, side="right")) - 1
        chosen = [last - step for step in (0, 1, 3, 7, 15, 31)]
        return [end for end in chosen if end >= 2]

    def _stops(self) -> Sequence[Polynomials]:
        """Stops at once, the fastest first, and what the robot would run without this chunk."""
        if not self.state[1:].any():
            return [self._standing()]
        limits = self.prepared.limits
        stops = [Polynomials(*core.stop_curve(self.state, limits, share)) for share in (1.0, GENTLER)]
        stops = [stop for stop in stops if len(stop.coefficients)]
        if self.running is not None:
            stops.append(Polynomials(self.running.breakpoints, self.running.coefficients))
        return stops or [self._standing()]

    def _standing(self) -> Polynomials:
        return Polynomials(np.array([0.0, STANDSTILL]), self.state[None, :1].copy())

    def _answer(
        self,
        outcome: Outcome,
        motion: Polynomials | None,
        until: float,
        reached: int,
        reason: str = "",
        verdict: MotionVerdict | None = None,
        set_points: Array | None = None,
        change: Array | None = None,
    ) -> Chunk:
        names = self.problem.robot.joint_names
        return Chunk(
            outcome,
            None if motion is None else Trajectory(names, *motion),
            until,
            reached,
            self.times,
            self.Q if set_points is None else set_points,
            np.zeros(len(self.Q)) if change is None else change,
            reason,
            (np.inf, np.inf) if verdict is None else verdict.clearance,
            (INTERPOLATION, *self.prepared.proof.scope),
            _problem=self.problem,
            _poses=self.poses,
        )
