"""`Executor`: the set-points of a verified run, one a tick, at a speed that changes on the way."""

import math
from collections import deque
from collections.abc import Mapping
from typing import TYPE_CHECKING, Literal

import numpy as np

from optiplan.arrays import is_finite
from optiplan.errors import OptiPlanError, wrong_argument
from optiplan.execution.arguments import is_share, same_state, told
from optiplan.execution.path_laws import PathPlace, SetPoint
from optiplan.execution.proved_path import PathStretch, ProvedPath
from optiplan.execution.scene_watch import BlockedPlace
from optiplan.execution.seen_scene import SeenScene
from optiplan.execution.status import Ahead, Phase, Status, Stopping, Tick
from optiplan.execution.stop_ahead import way_ahead
from optiplan.execution.tracking_monitor import TrackingMonitor, TrackingPolicy
from optiplan.geometry.pose import Pose, Values
from optiplan.runs.run import Run
from optiplan.trajectory.segments import Segment
from optiplan.trajectory.state import State

if TYPE_CHECKING:
    from optiplan._core._core_base import TimeLaw

LONGEST_TICK = 0.1
"""s: after a longer one the robot had no set-points for too long, and stops."""

TOO_LATE = "the stop comes too late"
"""What a reason says where the robot would not stand still in time."""

KEPT_STATES = 64
"""Predicted states that a splice may begin at."""

STOP_PLACES = 200
"""Places of a motion for which `stopping` gives the stop."""


class Executor:
    """Run a verified motion without leaving what was proved.

    Every set-point lies on the verified path. Its speed is a law s(t) that keeps the joints' limits of velocity,
    acceleration, jerk and torque at all times, also while it changes. At every time there is a law until the robot
    stands still; a change replaces it only by another such law. Where limits leave no room for a change, as in the
    middle of the strongest braking, it begins as soon as they do. See `PathLaws` for the formulas.

    Args:
        run: a verified run of `op.plan`, among obstacles that stand still.
        override: speed at the start, 0 to 1.
        deviation: how far a measured joint may be from the path, rad or m, before the robot stops; None: anything. The
            tracking error of the run is a bound of its own.
        clearance: distance to keep from obstacles that `update_scene` moves, m.
        tracking: how far a measured robot may lag behind, and how old its states may be.

    Attributes:
        run: the run that is being executed.
        time: since the first tick, s.

    Raises:
        InputError: the run is not verified, or its proof holds for its own timing alone.

    Example:
        >>> import optiplan as op
        >>> executor = op.Executor(op.plan(op.load_problem("01_reach")))
        >>> executor.override = 0.3
        >>> while executor.status.phase != "done":
        ...     set_point = executor.tick(0.001)
        >>> executor.status.place == executor.run.duration
        True
    """

    def __init__(
        self,
        run: Run,
        *,
        override: float = 1.0,
        deviation: float | None = None,
        clearance: float = 0.0,
        tracking: TrackingPolicy | None = None,
    ) -> None:
        if not is_share(override):
            raise wrong_argument("Executor", "override", told(override), "a speed from 0 to 1")
        if deviation is not None and not (is_finite(deviation) and deviation > 0.0):
            raise wrong_argument("Executor", "deviation", told(deviation), "a distance > 0, rad or m, or None")
        if not (is_finite(clearance) and clearance >= 0.0):
            raise wrong_argument("Executor", "clearance", told(clearance), "a distance >= 0, m")
        if tracking is not None and not isinstance(tracking, TrackingPolicy):
            raise wrong_argument("Executor", "tracking", told(tracking), "an op.TrackingPolicy(…), or None")
        self._path = ProvedPath(run, "Executor")
        self._scene = SeenScene(self._path, float(clearance))
        self._tracking = TrackingMonitor(self._path, deviation, tracking or TrackingPolicy())
        self._stretch: PathStretch = self._path.forwards
        self.time = 0.0
        self._override, self._wanted = float(override), float(override)
        self._law: TimeLaw = self._start_law(self._path, float(override))
        self._held: Literal["", "paused", "waiting", "stopped"] = "" if override > 0.0 else "paused"
        self._reason = ""
        self._seen = -math.inf  # the place up to which events are done
        self._predicted: deque[tuple[float, State, TimeLaw]] = deque(maxlen=KEPT_STATES)
        self._next: tuple[float, ProvedPath, float] | None = None  # when it takes over, and when it was handed over
        self._pending = False
        self._backwards = False
        self._missed: tuple[Segment, ...] = ()
        if self._law.target != override:  # it begins in motion
            self._aim()

    @property
    def run(self) -> Run:
        """The run that is being executed."""
        return self._path.run

    @property
    def override(self) -> float:
        """Speed that is wanted, 0 to 1 of the planned motion's; set it at any time."""
        return self._override

    @override.setter
    def override(self, speed: float) -> None:
        if not is_share(speed):
            self.stop(f"override: found {told(speed)}; expected a speed from 0 to 1")
            return
        self._override = float(speed)
        self._aim()

    def pause(self) -> None:
        """Stop along the path; `resume` goes on."""
        if self._held in ("", "waiting"):
            self._held, self._reason = "paused", ""
            self._aim()

    def stop(self, reason: str = "asked to stop") -> None:
        """Stop along the path, for the given reason; `resume` goes on."""
        self._held, self._reason, self._next = "stopped", reason, None
        self._aim()

    def resume(self) -> None:
        """Go on with the speed of `override`, forwards."""
        self._held, self._reason, self._backwards = "", "", False
        self._aim()

    def reverse(self) -> None:
        """Stop, and go back along the path at the speed of `override`, to the last event of a task or the start."""
        self._held, self._reason, self._backwards = "", "", True
        self._aim()

    def update_scene(
        self, poses: Mapping[str, Pose], velocities: Mapping[str, Values] | None = None, spread: float = 0.0
    ) -> None:
        """Obstacles of the scene have moved: check the rest of the path against them, now.

        Where they block it, the robot stops along the path and waits; a later update that leaves the path clear lets it
        go on. Nothing raises here: an update that cannot be used ends in a stop.

        Args:
            poses: of obstacles of the scene, by name.
            velocities: (3,) m/s, of the frames of some of them; the others stand still.
            spread: m/s; how fast they may depart from that course, in any direction.
        """
        reason = self._scene.see(poses, {} if velocities is None else velocities, spread, self.time)
        if reason:
            self.stop(reason)
            return
        if self._held == "waiting" and self._next is None:
            ahead = self._stretch.laws.change(PathPlace(*self._law.at(self.time)), self.time, self._override)
            if ahead is not None and self._blocked(ahead) is None:
                self._held, self._reason = "", ""
                self._aim()
                return
        self._yield()

    def _blocked(self, law: "TimeLaw") -> BlockedPlace | None:
        return self._scene.blocked(self._stretch, law, self.time)

    def _yield(self) -> None:
        """Wait, where obstacles that were seen block the way of the law."""
        found = self._blocked(self._law)
        if found is None:
            return
        if not self._held:
            self._held, self._next = "waiting", None
            self._reason = f"'{found.pair[0]}' would meet '{found.pair[1]}' at {found.place:.3f} s of the path"
            self._lead()
            found = self._blocked(self._law)
        if found is not None and TOO_LATE not in self._reason:
            self._reason += f"; {TOO_LATE}" if self._reason else TOO_LATE

    def state_in(self, latency: float) -> State:
        """Return the state of the robot `latency` s from now, if nothing is changed until then.

        A motion that is planned from it can be handed to `splice`.

        Raises:
            InputError: the latency is no number of seconds >= 0.
        """
        if not is_finite(latency) or latency < 0.0:
            raise wrong_argument("Executor.state_in", "latency", told(latency), "seconds >= 0")
        then = self.time + float(latency)
        point = self._stretch.laws.set_point(self._law, then)
        state = State(point.q, point.v, point.a)
        self._predicted.append((then, state, self._law))
        return state

    def ahead(self, lead: float) -> Ahead:
        """Return the next `lead` s, if nothing is changed, and the stop along the path from there, for a driver."""
        return way_ahead(self._stretch.laws, self._law, self.time, lead)

    def is_along(self, ahead: Ahead) -> bool:
        """Whether the law is still the one that leads to `ahead`."""
        return self._law is ahead.along

    def follow(self, ahead: Ahead, reason: str) -> None:
        """Take over the stop of `ahead` in a robot that began it by itself at `ahead.turn`, which is now."""
        self._held, self._reason, self._next, self._pending = "stopped", reason, None, False
        self._law = ahead.law

    def splice(self, run: Run | ProvedPath) -> bool:
        """Let another verified run take over where it begins: in a state that `state_in` returned.

        Position, velocity and acceleration are continuous there. Where the run comes too late, where it is not
        verified, or where the speed is changed between the prediction of its state and its begin, the robot stops along
        its path instead. A `ProvedPath` of the run, made before, takes no time here.

        Returns:
            Whether the run takes over.
        """
        reason = self._splice(run)
        if reason:
            self.stop(reason)
        return not reason

    def _splice(self, given: Run | ProvedPath) -> str:
        try:
            path = given if isinstance(given, ProvedPath) else ProvedPath(given, "Executor.splice")
        except OptiPlanError as error:
            return f"the motion that was to take over: {error}"
        run = path.run
        if run.problem.robot.joint_names != self.run.problem.robot.joint_names:
            return "the motion that was to take over is of another robot"
        start = run.problem.start_state
        found = [then for then, state, law in self._predicted if law is self._law and same_state(state, start)]
        if not found:
            return "the motion that was to take over begins in a state that is not on the way"
        stands = self._law.target == 0.0 and self._law.settled <= found[-1]  # and from then on is in that state
        then = max(found[-1], self.time) if stands else found[-1]
        if then < self.time:
            return f"the motion that was to take over came {self.time - then:.3f} s late"
        self._tracking.prepare(path)
        self._next = then, path, self.time
        return ""

    def tick(self, dt: float, measured: object = None) -> Tick:
        """Return the set-point `dt` s after the last one.

        Nothing raises here: what cannot be, such as a time that runs backwards, ends in a stop along the path.

        Args:
            dt: s since the last tick.
            measured: positions of the joints (n,), rad or m, a `State` or a `Measurement`; None: not measured.
        """
        step = self._checked_step(dt)
        if self._next is not None and self.time + step >= self._next[0]:
            self._take_over()
        now = self.time
        self.time += step
        if self._pending and self._replace_law():
            self._yield()
        if self._law.target == 0.0 and self.time >= self._law.settled:
            self._turn()
        point = self._point()
        place = self._stretch.place(point.place.s)
        reason = self._tracking.tick(measured, now, self.time, point.q, place)
        if reason and self._held != "stopped":
            self.stop(reason)
        events = self._due(place)
        speed = self._stretch.direction * point.place.speed
        return Tick(self.time, point.q, point.v, point.a, point.torque, events, self._status(place, speed))

    @property
    def status(self) -> Status:
        """What the executor is doing at the last tick."""
        point = self._point()
        return self._status(self._stretch.place(point.place.s), self._stretch.direction * point.place.speed)

    def stopping(self, places: int = STOP_PLACES) -> Stopping:
        """Return the stop along the path from full speed, at equally spaced places of the motion."""
        laws, T = self._path.forwards.laws, self._path.motion.duration
        place = np.linspace(0.0, T, places)
        time, travel = np.zeros(places), np.zeros(places)
        for k, s in enumerate(place):
            law = laws.change(PathPlace(float(s), 1.0, 0.0), 0.0, 0.0)
            time[k] = T - s if law is None else law.settled
            travel[k] = T - s if law is None else min(law.at(law.settled)[0], T) - s
        return Stopping(place, time, travel)

    def _start_law(self, path: ProvedPath, speed: float) -> "TimeLaw":
        """Return the law at the start of a motion: at rest any speed will do, in motion that of the plan."""
        return path.forwards.laws.steady(0.0, speed if path.starts_at_rest else 1.0, self.time)

    def _aim(self) -> None:
        """Let the law lead to the wanted speed, at once or as soon as limits leave room for it."""
        if self._lead():
            self._yield()

    def _lead(self) -> bool:
        """See `_aim`; return whether there is another law."""
        turns = self._backwards != (self._stretch.direction < 0.0)
        self._wanted = 0.0 if self._held or turns else self._override
        replaced = self._replace_law()
        if turns and self._law.target == 0.0 and self._law.settled <= self.time:
            self._turn()
        return replaced

    def _replace_law(self) -> bool:
        """Replace the law by one that leads to the wanted speed, and return True; it stays while there is none."""
        s, speed, acceleration = self._law.at(self.time)
        length = self._stretch.laws.motion.duration
        if s >= length:  # at its end the robot stands still, whatever the law
            self._law, self._pending = self._stretch.laws.steady(length, 0.0, self.time), False
            return False
        if self._law.target == self._wanted:  # it is on its way there
            self._pending = False
            return False
        self._pending = True
        law = self._stretch.laws.change(PathPlace(s, speed, acceleration), self.time, self._wanted)
        if law is None:
            return False
        self._law = law
        self._pending = law.target != self._wanted and law.at(law.settled)[0] < length
        if self._next is not None:  # it was to begin in a state that the robot does not come to any more
            self._next = None
            self.stop("the speed was changed before another motion could take over")
        return True

    def _turn(self) -> None:
        """Change the direction of a robot that stands still, if that is wanted."""
        if self._held or self._backwards == (self._stretch.direction < 0.0):
            return
        place = self._stretch.place(self._law.at(self.time)[0])
        stretch = self._path.backwards(place, self._seen) if self._backwards else self._path.forwards
        if stretch is None:
            return
        s = (place - stretch.start) * stretch.direction
        self._stretch, self._law = stretch, stretch.laws.steady(s, 0.0, self.time)
        self._aim()

    def _take_over(self) -> None:
        assert self._next is not None
        then, path, since = self._next
        self._missed = self._due(self._stretch.place(self._stretch.laws.set_point(self._law, then).place.s))
        self._path, self._stretch, self._next = path, path.forwards, None
        self._scene = self._scene.over(path, since)
        self._tracking.take_over(path)
        self._seen, self._backwards = -math.inf, False
        self._wanted = 0.0 if self._held else self._override
        self._law = path.forwards.laws.steady(0.0, self._wanted if path.starts_at_rest else 1.0, then)
        self._pending = self._wanted != self._law.target
        if not self._pending:
            self._yield()

    def _point(self) -> SetPoint:
        return self._stretch.laws.set_point(self._law, self.time)

    def _checked_step(self, dt: float) -> float:
        """Return the tick's length, s; where that cannot be, 0 or the longest, and the robot stops."""
        if not is_finite(dt) or dt < 0.0:
            self.stop(f"tick: found a step of {told(dt)}; expected seconds >= 0")
            return 0.0
        if dt > LONGEST_TICK:
            self.stop(f"tick: found a step of {dt:.3f} s; expected at most {LONGEST_TICK} s")
            return LONGEST_TICK
        return float(dt)

    def _due(self, place: float) -> tuple[Segment, ...]:
        """Return the events that have become due by a place of the path."""
        due = tuple(event for event in self._path.events if self._seen < event.begin <= place)
        self._seen = max(self._seen, place)
        due, self._missed = self._missed + due, ()
        return due

    def _status(self, place: float, speed: float) -> Status:
        T = self._path.motion.duration
        resting = speed == 0.0
        phase: Phase = "running"
        if place >= T:
            phase = "done"
        elif self._held == "stopped":
            phase = "stopped" if resting else "stopping"
        elif self._held in ("paused", "waiting") and resting:
            phase = self._held
        elif self.time < self._law.settled or self._pending:
            phase = "changing"
        elif resting:
            phase = "paused"
        off = self._tracking
        seen = off.deviation, off.lag, off.clearance
        return Status(phase, place, place / T, speed, self._override, self._reason, *seen)
