"""How far the measured robot is from the proved motion, and how old its states are."""

from typing import TYPE_CHECKING, Any

import numpy as np

from optiplan._core import core
from optiplan.arrays import Array, is_finite, number_argument
from optiplan.errors import described
from optiplan.execution.arguments import ROUNDED, numbers
from optiplan.execution.clearance_left import ClearanceLeft
from optiplan.execution.measurement import Measurement
from optiplan.execution.paths.proved_path import PathStretch, ProvedPath
from optiplan.records import dataclass
from optiplan.trajectory.state import State

if TYPE_CHECKING:
    from optiplan._core._core_base import TimeLaw

LEAP = 0.1
"""s by which stamps may run ahead of the ticks: so long a tick may be missing."""

FAST, STEP = 2.0, 5e-3
"""Times the limit of velocity, and rad or m: a state that changes by more between two stamps has jumped."""

LEAST = 1e-9
"""rad or m: a joint without a tube may be so far off."""

SPACING = 2e-3
"""s between two set-points that are kept, at most; 10 rad/s² leave the straight line between them by 5e-6 rad."""

FAR = 0.01
"""rad or m: unit in which joints without a bound are compared."""

MORE_KEPT = 0.1
"""s of set-points that are kept beyond the oldest that is needed, so that a larger lag is seen as one."""


@dataclass(frozen=True)
class TrackingPolicy:
    """When an executor stops a robot that is measured.

    Attributes:
        most_lag: how far the robot may be behind its set-point along the path, s of the planned motion.
        latency: age of measured positions and of an `op.State`, s; an `op.Measurement` says its own.
        oldest: how old a state may be, and for how long there may be no new one after the first, s.
        least_clearance: the robot stops where less than this, m, is left of the proved clearance with the joints where
            they are measured; None: that is not watched.

    Raises:
        InputError: a time or a distance that is none.

    Example:
        >>> import optiplan as op
        >>> run = op.plan(op.load_problem("01_reach"), tracking_error=0.002)
        >>> executor = op.Executor(run, tracking=op.TrackingPolicy(most_lag=0.05, latency=0.004))
        >>> executor.tick(0.001, measured=run.trajectory.start).status.deviation
        0.0
    """

    most_lag: float = 0.25
    latency: float = 0.0
    oldest: float = 0.1
    least_clearance: float | None = None

    def __post_init__(self) -> None:
        for name in ("most_lag", "latency", "oldest"):
            number_argument("TrackingPolicy", name, getattr(self, name), "0 to 10 s", 0.0, most=10.0)
        if (least := self.least_clearance) is not None:
            number_argument("TrackingPolicy", "least_clearance", least, "a distance >= 0, m, or None", 0.0)


class TrackingMonitor:
    """Compare measured states with the set-points sent so far, which are the passed part of the proved motion.

    A lag lies on the path. With the set-points p(t) so far, the joints are off by |q - p| at the nearest of them: the
    motion is proved for these joints where that is within its tracking error.

    Args:
        path: that is executed.
        deviation: how far each joint may be from the path, rad or m, beside the tracking error of the run; None: any.
        policy: of lag, age and clearance.

    Attributes:
        deviation: the largest distance of a joint from the path so far, rad or m; None without measurements.
        lag: how far the robot was behind its set-point when it was last measured, s of the planned motion.
        clearance: what was left then of the proved clearance, m; None where that is not watched.
    """

    def __init__(self, path: ProvedPath, deviation: float | None, policy: TrackingPolicy) -> None:
        self._most, self._policy = deviation, policy
        kept = policy.most_lag + policy.oldest + MORE_KEPT
        self._noted = 0.0  # time of the last set-point in the history, s
        self._history = core.SetPointHistory(path.motion.n, kept, SPACING)
        self._history.note(0.0, path.motion.start, 0.0, 0)
        self._proved: list[tuple[Array, Array, ClearanceLeft | None]] = []  # limits as stated, as checked
        self.deviation: float | None = None
        self.lag: float | None = None
        self.clearance: float | None = None
        self._stamp: float | None = None
        self._fresh = self._seen = 0.0  # when the stamp last advanced, and when there last was a state
        self._before: tuple[float, Array] | None = None  # a state and when it was measured
        self.take_over(path)

    @property
    def allowed(self) -> Array:
        """(n,) rad or m: how far each joint may be from the path; inf: anything."""
        return self._proved[-1][0]

    def prepare(self, path: ProvedPath) -> None:
        """Compute what is needed of a path that will take over, which may take a while."""
        if self._policy.least_clearance is not None:
            _ = path.clearance_left

    def take_over(self, path: ProvedPath) -> None:
        """Go on with another path."""
        self._path, problem = path, path.run.problem
        error = np.array(problem.tracking_error) if problem.tracking_error.any() else np.full(problem.robot.n, np.inf)
        between = problem.limits.acceleration * SPACING**2 / 8.0
        stated = np.minimum(error, np.inf if self._most is None else self._most)
        limit = np.maximum(stated - between, LEAST)
        left = None if self._policy.least_clearance is None else path.clearance_left
        self._proved.append((stated, limit, left))
        self._weights = 1.0 / np.minimum(limit, FAR)
        self._fastest = FAST * problem.limits.velocity
        self._endless = problem.robot.endless if problem.robot.endless.any() else None

    def age(self, duration: float) -> None:
        """Let a time, s, pass without ticks: states are so much older."""
        self._fresh, self._seen = self._fresh - duration, self._seen - duration

    def pass_along(self, stretch: PathStretch, law: "TimeLaw", until: float, *, on_path: bool = True) -> None:
        """Take the set-points on the way of a law from the last one until a time, s, or until it stands still."""
        end = min(until, law.settled) if law.target == 0.0 else until
        while end - self._noted > SPACING + ROUNDED:
            self._noted += SPACING
            point = stretch.laws.set_point(law, self._noted)
            self._note(self._noted, point.q, stretch.place(point.place.s), on_path)

    def _note(self, time: float, q: Array, place: float, on_path: bool) -> None:
        self._noted = time
        self._history.note(time, q, place, 2 * len(self._proved) - (2 if on_path else 1))

    def tick(self, measured: Any, now: float, time: float, q: Array, place: float, *, on_path: bool = True) -> str:
        """Take a set-point q (n,) at `time`, s, and what was measured `now`; return why to stop, or nothing."""
        self._note(time, q, place, on_path)
        if measured is None:
            silent = now - self._seen
            late = self.deviation is not None and silent > self._policy.oldest and place < self._path.motion.duration
            return f"there has been no state for {silent:.3f} s" if late else ""
        self._seen = now
        found, age, stamp = measured, self._policy.latency, now
        if isinstance(measured, Measurement):
            fault = self._age_fault(measured, now)
            if fault:
                return fault
            found, age, stamp = measured.q, measured.age, measured.stamp
        elif isinstance(measured, State):
            found = measured.q
        at = np.array(found if type(found) is np.ndarray and found.dtype == np.float64 else numbers(found))  # is kept
        if at.shape != q.shape or not np.isfinite(at).all():
            return f"measured: found {described(found)}; expected {len(q)} finite positions"
        if self._endless is not None:
            at = at + np.where(self._endless, 2.0 * np.pi * np.round((q - at) / (2.0 * np.pi)), 0.0)
        return self._compare(at, now - age) or self._jump(at, stamp)

    def _age_fault(self, measured: Measurement, now: float) -> str:
        """Return what is wrong with the times of a state, or nothing; `now`, s, is that of the ticks."""
        stamp, age, last = measured.stamp, measured.age, self._stamp
        if not (is_finite(stamp) and is_finite(age) and age >= 0.0):
            found = f"a stamp of {described(stamp)}, an age of {described(age)}"
            return f"measured: found {found}; expected seconds, an age >= 0"
        self._stamp, passed = stamp, now - self._fresh
        if last is None or stamp != last:
            self._fresh = now
        if age > self._policy.oldest:
            return f"the state is {age:.3f} s old, more than {self._policy.oldest:g} s"
        if last is None:
            return ""
        if stamp < last:
            return f"the stamps of states ran backwards by {last - stamp:.3f} s"
        if stamp == last and passed > self._policy.oldest:
            return f"the stamp of states has been the same for {passed:.3f} s"
        if stamp - last > passed + LEAP:
            return f"the stamps of states leapt by {stamp - last:.3f} s in {passed:.3f} s"
        return ""

    def _jump(self, q: Array, stamp: float) -> str:
        """Return which joint cannot have moved so far since the last state, or nothing."""
        before, self._before = self._before, (stamp, q)
        if before is None:
            return ""
        moved = np.abs(q - before[1])
        beyond = moved - (self._fastest * max(stamp - before[0], 0.0) + STEP)
        j = int(beyond.argmax())
        if beyond[j] <= 0.0:
            return ""
        return f"the state of {self._name(j)} jumped by {moved[j]:.4g} in {max(stamp - before[0], 0.0):.4f} s"

    def _compare(self, q: Array, time: float) -> str:
        """Return why the robot, which was at q (n,) at a time, s, is not where the motion is proved, or nothing."""
        off, place, progress, epoch = self._history.nearest(q, self._weights)
        stated, limit, left = self._proved[epoch // 2]
        self.deviation = max(self.deviation or 0.0, float(off.max()))
        self.lag = self._history.progress_at(time) - progress
        beyond = off - limit
        j = int(beyond.argmax())
        if beyond[j] > 0.0:
            return f"{self._name(j)} is {off[j]:.4g} off the path, farther than {stated[j]:g}"
        if self.lag > self._policy.most_lag:
            return f"the robot is {self.lag:.3f} s behind on the path, more than {self._policy.most_lag:g} s"
        self.clearance = None
        if left is not None and epoch % 2 == 0:  # a joint stop that left the path has a clearance of its own
            self.clearance = left.least(place, off)
            least = self._policy.least_clearance or 0.0
            if self.clearance < least or self.clearance <= 0.0:
                return f"{1e3 * self.clearance:.3g} mm are left of the proved clearance, less than {1e3 * least:g} mm"
        return ""

    def _name(self, joint: int) -> str:
        return self._path.run.problem.robot.joint_names[joint]
