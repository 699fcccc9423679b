"""The search behind `certify`: the chunk as it is, the nearest one, stops; each is proved before it is an answer."""

from collections.abc import Mapping, Sequence
from dataclasses import field
from threading import Lock
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from optiplan._core import core
from optiplan.arrays import Array, Flags
from optiplan.execution.chunks.chunk import Chunk, Outcome
from optiplan.problem.problem import Problem
from optiplan.records import dataclass
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.warm_proof import MotionVerdict, Polynomials, WarmProof

INTERPOLATION = (
    "cubic spline through the set-points at their times, with continuous acceleration; it begins in the robot's state, "
    "with one more knot in the middle of the first interval; then every joint stops as fast as its limits allow"
)

SAME = 1e-9
"""rad or m, or s: set-points or times that are no farther apart are one."""

HUGE = 1e5
"""rad or m, or s: set-points and times beyond are numbers gone wrong."""

DISTANCES = (1e-3, 2e-3, 4e-3)
"""m, beyond the clearance: what the nearest chunk keeps between samples, tried in this order."""

FARTHEST = 0.6
"""rad or m: the nearest chunk changes no set-point by more in one joint."""

WINDOW, WIDTH = 0.02, 0.02
"""Pairs nearer than this, m, in the middles of parts of the motion no longer than this, s, are kept apart."""

GENTLER = 0.7
"""Share of the limits of acceleration for the nearest chunk, where torques are the reason, and for a stop."""

STANDSTILL = 0.1
"""s: the stop of a robot that stands."""


class Prepared(NamedTuple):
    """What is kept of a problem, for one thread at a time.

    `limits` (5, n) are those of position, velocity, acceleration and jerk.
    """

    proof: WarmProof
    limits: Array
    lock: Lock


@dataclass(eq=False)
class ChunkSearch:
    """One call of `certify`."""

    problem: Problem
    prepared: Prepared
    Q: Array
    given: Array | None
    state: Array
    running: Trajectory | None
    poses: Mapping[str, pin.SE3]
    clearance: float
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
            return self._stop(off) if off else self._standstill()
        wanted, rests = np.ascontiguousarray(self.Q[used]), self.given is None
        if self.given is None:
            found = core.chunk_times(self.state, wanted, self.prepared.limits)
            if not len(found):
                return self._stop("no times within the limits of the joints were found")
            self.times = np.concatenate([[0.0], found])[np.cumsum(used)]
        times = self.times[used]
        motion = Polynomials(*core.chunk_curve(self.state, wanted, times, rests, self.prepared.limits))
        verdict = self._prove(motion)
        if verdict.proved and not off:
            return self._answer("proved", _Sent(motion, verdict, float(times[-1]), len(self.Q)))
        reason = off or verdict.reason
        return self._nearest(wanted, times, rests, used, reason) or self._stop(reason, motion, verdict)

    def _prove(self, motion: Polynomials) -> MotionVerdict:
        return self.prepared.proof.prove(motion, self.state, self.clearance)

    def _wrong(self) -> str:
        """Return what is wrong with the numbers, or nothing."""
        bad: Flags = ~(np.abs(self.Q) <= HUGE)
        if bad.any():
            row, joint = (int(k[0]) for k in np.nonzero(bad))
            return f"set-point {row} has {self.Q[row, joint]} for '{self.problem.robot.joint_names[joint]}'"
        if self.given is None:
            return ""
        possible: Flags = (self.given >= 0.0) & (self.given <= HUGE)
        if not possible.all():
            k = int(np.argmin(possible))
            return f"set-point {k} is at time {self.given[k]} s, not from 0 to {HUGE:.0f} s"
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
        if self._too_far(wanted, times):
            return None
        search = proof.nearest(self.state, wanted, times, rests, limits, FARTHEST)
        gentle = False
        for distance in DISTANCES:
            found = search.step(distance, self.clearance, WINDOW, WIDTH)
            if found is None:
                return None
            motion = Polynomials(*found)
            verdict = self._prove(motion)
            if verdict.proved:
                moved = np.vstack([self.state[:1], search.set_points()])[np.cumsum(used)]
                change = np.linalg.norm(moved - self.Q, axis=1)
                sent = _Sent(motion, verdict, float(times[-1]), len(self.Q), moved, change)
                return self._answer("nearest", sent, reason)
            if verdict.torque and not gentle:
                gentle, limits = True, limits * np.array([1.0, 1.0, 1.0, GENTLER, 1.0])[:, None]
                search = proof.nearest(self.state, wanted, times, rests, limits, FARTHEST)
        return None

    def _too_far(self, wanted: Array, times: Array) -> bool:
        """Whether limits of position or velocity alone ask for larger changes of set-points than `FARTHEST`."""
        lower, upper, velocity = self.prepared.limits[:3]
        steps = np.abs(np.diff(np.vstack([self.state[:1], wanted]), axis=0))
        reach = velocity * np.diff(times, prepend=0.0)[:, None] + 2.0 * FARTHEST
        return bool((steps > reach).any() or ((wanted < lower - FARTHEST) | (wanted > upper + FARTHEST)).any())

    def _stop(self, reason: str, motion: Polynomials | None = None, verdict: MotionVerdict | None = None) -> Chunk:
        """Follow the chunk as far as it is proved, and stop; else stop at once."""
        limits = self.prepared.limits
        if motion is not None and verdict is not None:
            for end in self._ends(motion, verdict.time):
                begun, pieces = motion.breakpoints[: end + 1].copy(), motion.coefficients[:end].copy()
                found = Polynomials(*core.with_stop(begun, pieces, limits))
                proved = self._prove(found)
                if proved.proved:
                    until = float(motion.breakpoints[end])
                    reached = int((self.times <= until + SAME).sum())
                    return self._answer("stopped", _Sent(found, proved, until, reached), reason)
        for found in self._stops():
            proved = self._prove(found)
            if proved.proved:
                return self._answer("stopped", _Sent(found, proved), reason)
        return self._answer("refused", _Sent(None, proved), f"{reason}; no stop is proved: {proved.reason}")

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

    def _standstill(self) -> Chunk:
        """The chunk of a robot that is where it shall be."""
        if self.state[1:].any():
            return self._stop("the robot is in motion where the chunk ends")
        self.times = self.times if len(self.times) else np.zeros(len(self.Q))
        standing = self._standing()
        verdict = self._prove(standing)
        if not verdict.proved:
            return self._stop(verdict.reason)
        return self._answer("proved", _Sent(standing, verdict, 0.0, len(self.Q)))

    def _answer(self, outcome: Outcome, sent: "_Sent", reason: str = "") -> Chunk:
        names, nothing = self.problem.robot.joint_names, np.zeros(len(self.Q))
        return Chunk(
            outcome,
            None if sent.motion is None else Trajectory(names, *sent.motion),
            sent.until,
            sent.reached,
            self.times,
            self.Q if sent.set_points is None else sent.set_points,
            nothing if sent.change is None else sent.change,
            reason,
            sent.verdict.clearance,
            (INTERPOLATION, *self.prepared.proof.scope(self.clearance)),
            _problem=self.problem,
            _poses=self.poses,
        )


class _Sent(NamedTuple):
    """What is answered: the motion with its verdict; the rest as in `Chunk`, where it is not as it was given."""

    motion: Polynomials | None
    verdict: MotionVerdict
    until: float = 0.0
    reached: int = 0
    set_points: Array | None = None
    change: Array | None = None
