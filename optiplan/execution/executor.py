"""`Executor`: the set-points of a verified run, one a tick, at a speed that changes on the way."""

import math
import weakref
from collections import deque
from collections.abc import Mapping
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from optiplan.arrays import is_finite
from optiplan.errors import OptiPlanError, wrong_argument
from optiplan.execution.arguments import is_share, same_state, told
from optiplan.execution.joint_stop import Detour, JointStops
from optiplan.execution.path_laws import PathPlace, SetPoint
from optiplan.execution.planning_process import PlanningProcess
from optiplan.execution.policy import Policy, Reaction
from optiplan.execution.proved_path import PathStretch, ProvedPath
from optiplan.execution.scene_watch import BlockedPlace, SceneWatch
from optiplan.execution.seen_scene import SceneUpdate, SeenScene
from optiplan.execution.status import Phase, Status, Stopping, Tick
from optiplan.execution.tracking_monitor import TrackingMonitor
from optiplan.geometry.pose import Values
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


class NextPath(NamedTuple):
    """The path that is to take over at `then`, s; `since`, s, is the scene known that it was planned in.

    `number`: of the planning process; 0: it is from `splice`.
    """

    then: float
    path: ProvedPath
    since: float
    watch: SceneWatch | None = None
    number: int = 0


class Executor:
    """Run a verified motion without leaving what was proved.

    Every set-point lies on the verified path. Its speed is a law s(t) that keeps the joints' limits of velocity,
    acceleration, jerk and torque at all times, also while it changes. At every time there is a law until the robot
    stands still; a change replaces it only by another such law. Where limits leave no room for a change, as in the
    middle of the strongest braking, it begins as soon as they do. See `PathLaws` for the formulas.

    Args:
        run: a verified run of `op.plan`, among obstacles that stand still.
        override: speed at the start, 0 to 1.
        deviation: how far a measured joint may be from its set-point, rad or m, before the robot stops; None: anything.
        clearance: distance to keep from obstacles that `update_scene` moves, m.
        policy: what is done where they block the path: an `op.Policy`, or the name of its reaction.

    Attributes:
        run: the run that is being executed.
        time: since the first tick, s.

    Raises:
        InputError: the run is not verified, or its proof holds for its own timing alone; `replan` of a task or vias.

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
        policy: Policy | Reaction = "wait",
    ) -> None:
        if not isinstance(run, Run):
            raise wrong_argument("Executor", "run", told(run), "a verified run of op.plan(…)")
        if not is_share(override):
            raise wrong_argument("Executor", "override", told(override), "a speed from 0 to 1")
        if deviation is not None and not (is_finite(deviation) and deviation > 0.0):
            raise wrong_argument("Executor", "deviation", told(deviation), "a distance > 0, rad or m, or None")
        if not (is_finite(clearance) and clearance >= 0.0):
            raise wrong_argument("Executor", "clearance", told(clearance), "a distance >= 0, m")
        self._path = ProvedPath(run, "Executor")
        self._policy = Policy.of(policy)
        watch = SceneWatch(self._path, float(clearance), self._policy.linger)
        self._scene = SeenScene(watch)
        self._planning: PlanningProcess | None = None
        if self._policy.reaction != "wait":
            watch.prepare(self._path.forwards)
        if self._policy.reaction == "replan":
            self._planning = PlanningProcess(run, watch, self._policy)
            weakref.finalize(self, self._planning.close)
        self._tracking = TrackingMonitor(deviation)
        self._stretch: PathStretch = self._path.forwards
        self._stops = JointStops(self._path)
        self._detour: Detour | None = None
        self.time = 0.0
        self._override, self._wanted = float(override), float(override)
        self._law: TimeLaw = self._first_law(self._path, float(override), 0.0)
        self._held: Literal["", "paused", "waiting", "stopped"] = "" if override > 0.0 else "paused"
        self._reason = ""
        self._seen = -math.inf  # the place up to which events are done
        self._predicted: deque[tuple[float, State, TimeLaw]] = deque(maxlen=KEPT_STATES)
        self._next: NextPath | None = None
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

    def stop(self, reason: str = "asked to stop", how: str = "path") -> None:
        """Stop, for the given reason; `resume` goes on.

        Args:
            reason: for `status`.
            how: `path`: along the path. `joints`: each joint as fast as its limits allow, off the path, where that is
                proved clear and faster; `clearance` is kept from all obstacles. `resume` then leads back to the path.
        """
        known = how in ("path", "joints")
        self._held, self._next = "stopped", None
        self._reason = reason if known else f"stop: found {told(how)}; expected 'path' or 'joints'"
        self._aim()
        if how == "joints" and self._detour is None and not self._stands:
            within = self._law.settled - self.time if self._law.target == 0.0 else math.inf
            detour = self._stops.leave(self._stretch, self._law, self.time, within)
            if detour is not None and self._scene.blocked(detour.stop, detour.law, self.time, known=True) is None:
                self._detour, self._stretch, self._law, self._pending = detour, detour.stop, detour.law, False

    def resume(self) -> None:
        """Go on with the speed of `override`, forwards."""
        self._held, self._reason, self._backwards = "", "", False
        self._aim()

    def reverse(self) -> None:
        """Stop, and go back along the path at the speed of `override`, to the last event of a task or the start."""
        self._held, self._reason, self._backwards = "", "", True
        self._aim()

    def update_scene(
        self, poses: SceneUpdate, velocities: Mapping[str, Values] | None = None, spread: float = 0.0
    ) -> None:
        """Obstacles have moved, appeared or vanished: check the rest of the path against them, now.

        Where they block it, the policy decides: by default the robot stops along the path and waits; a later update
        that leaves the path clear lets it go on. Nothing raises here: an update that cannot be used ends in a stop.

        Args:
            poses: by name: the pose of a known obstacle, another one (`op.Sphere(…)` …), or None for one that is gone.
            velocities: (3,) m/s, of the frames of some of them; the others stand still.
            spread: m/s; how fast they may depart from that course, in any direction.
        """
        reason = self._scene.see(poses, {} if velocities is None else velocities, spread, self.time)
        if reason:
            self.stop(reason)
            return
        if self._next is not None and self._next.number and self._blocked_next(self._next):
            self._next = None
        if self._held == "waiting" and self._next is None:
            ahead: TimeLaw | None = self._law
            if self._detour is None:
                ahead = self._stretch.laws.change(PathPlace(*self._law.at(self.time)), self.time, self._override)
            if ahead is not None and self._blocked(ahead) is None:
                self._held, self._reason = "", ""
                self._aim()
                return
        self._yield()

    def _blocked(self, law: "TimeLaw") -> BlockedPlace | None:
        return self._scene.blocked(self._stretch, law, self.time)

    def _blocked_next(self, coming: NextPath) -> bool:
        law = self._first_law(coming.path, self._override, coming.then)
        scene = self._scene.over(coming.path, coming.since, coming.watch)
        return scene.blocked(coming.path.forwards, law, coming.then) is not None

    def _yield(self) -> None:
        """Do as the policy says, where obstacles that were seen block the way of the law."""
        found = self._blocked(self._law)
        if found is not None and not self._held:
            self._held, self._next = "stopped" if self._policy.reaction == "stop" else "waiting", None
            self._reason = f"'{found.pair[0]}' would meet '{found.pair[1]}' at {found.place:.3f} s of the path"
            self._avoid()
            found = self._blocked(self._law)
        elif self._held == "waiting" and self._next is None and (found or self._policy.reaction == "slow"):
            self._avoid()
            found = self._blocked(self._law)
        if found is not None and TOO_LATE not in self._reason:
            self._reason += f"; {TOO_LATE}" if self._reason else TOO_LATE
        if self._held == "waiting" and self._next is None and self._planning is not None and not self._backwards:
            self._planning.seek(self._law, self.time, self.state_in, self._scene)

    def _avoid(self) -> None:
        """Follow a law that is clear until the robot stands still, or stop now."""
        clear = self._policy.law(
            self._stretch.laws, self._law, self.time, self._override, lambda law: self._blocked(law) is not None
        )
        if clear is None and not self._stands:
            clear = self._stretch.laws.change(PathPlace(*self._law.at(self.time)), self.time, 0.0)
        if clear is not None:
            self._law, self._wanted, self._pending = clear, 0.0, False
        else:  # as soon as limits leave room
            self._lead()

    @property
    def _stands(self) -> bool:
        return self._law.target == 0.0 and self._law.settled <= self.time

    def _accept(self, planning: PlanningProcess) -> None:
        """Let a path of the policy take over, if it came in time and is clear."""
        if planning.lost:
            self._planning = None
            self.stop("the planning process has ended")
            return
        planned = planning.answer()
        if planned is None or planned.path is None or self._held != "waiting" or self._next is not None:
            return
        stands = self._stands and planned.path.starts_at_rest
        then = max(planned.then, self.time) if stands else planned.then
        if planned.law is not self._law or then < self.time:
            return
        coming = NextPath(then, planned.path, planned.since, planned.watch, planned.number)
        if not self._blocked_next(coming):
            self._next = coming

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

    def splice(self, run: Run) -> bool:
        """Let another verified run take over where it begins: in a state that `state_in` returned.

        Position, velocity and acceleration are continuous there. Where the run comes too late, where it is not
        verified, or where the speed is changed between the prediction of its state and its begin, the robot stops along
        its path instead.

        Returns:
            Whether the run takes over.
        """
        reason = self._splice(run)
        if reason:
            self.stop(reason)
        return not reason

    def _splice(self, run: Run) -> str:
        if not isinstance(run, Run) or not run.verified:
            return "the motion that was to take over is not verified"
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
        try:
            self._next = NextPath(then, ProvedPath(run, "Executor.splice"), self.time)
        except OptiPlanError as error:
            return f"the motion that was to take over: {error}"
        return ""

    def tick(self, dt: float, measured: object = None) -> Tick:
        """Return the set-point `dt` s after the last one.

        Nothing raises here: what cannot be, such as a time that runs backwards, ends in a stop along the path.

        Args:
            dt: s since the last tick.
            measured: positions of the joints (n,), rad or m, or a `State`; None: not measured.
        """
        step = self._checked_step(dt)
        if self._planning is not None:
            self._accept(self._planning)
        if self._next is not None and self.time + step >= self._next.then:
            self._take_over(self._next)
        self.time += step
        if self._pending and self._replace_law():
            self._yield()
        if self._stands:
            self._turn()
        point = self._point()
        if measured is not None:
            reason = self._tracking.compare(measured, point, self.run.problem.robot.joint_names)
            if reason and self._held != "stopped":
                self.stop(reason)
        events = self._due(self._stretch.place(point.place.s))
        return Tick(self.time, point.q, point.v, point.a, point.torque, events, self._status(point.place))

    @property
    def status(self) -> Status:
        """What the executor is doing at the last tick."""
        return self._status(self._point().place)

    def stopping(self, places: int = STOP_PLACES) -> Stopping:
        """Return the stop along the path from full speed, at equally spaced places of the motion."""
        return self._path.stopping(np.linspace(0.0, self._path.motion.duration, places))

    def _first_law(self, path: ProvedPath, speed: float, begin: float) -> "TimeLaw":
        """Return the law at the start of a motion: at rest any speed will do, in motion that of the plan."""
        return path.forwards.laws.steady(0.0, speed if path.starts_at_rest else 1.0, begin)

    def _aim(self) -> None:
        """Let the law lead to the wanted speed, at once or as soon as limits leave room for it."""
        if self._lead():
            self._yield()

    def _lead(self) -> bool:
        """See `_aim`; return whether there is another law."""
        if self._detour is not None:
            return self._steer(self._detour)
        turns = self._backwards != (self._stretch.direction < 0.0)
        self._wanted = 0.0 if self._held or turns else self._override
        replaced = self._replace_law()
        if turns and self._law.target == 0.0 and self._law.settled <= self.time:
            self._turn()
        return replaced

    def _steer(self, detour: Detour) -> bool:
        """See `_lead`, off the path."""
        before, go = self._law, not self._held and self._override > 0.0
        self._stretch, self._law = detour.steer(self._stretch, before, self.time, go)
        self._pending = False
        if self._stretch is detour.left:
            self._detour = None
            self._lead()
        return self._law is not before

    def _replace_law(self) -> bool:
        """Replace the law by one that leads to the wanted speed, and return True; it stays while there is none."""
        s = self._law.at(self.time)[0]
        length = self._stretch.laws.length
        if s >= length:  # at its end the robot stands still, whatever the law
            self._law, self._pending = self._stretch.laws.steady(length, 0.0, self.time), False
            return False
        if self._law.target == self._wanted:  # it is on its way there
            self._pending = False
            return False
        self._pending = True
        law = self._stretch.laws.change_along(self._law, self.time, self._wanted)
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
        if self._detour is not None:
            if self._steer(self._detour):
                self._yield()
            return
        if self._held or self._backwards == (self._stretch.direction < 0.0):
            return
        place = self._stretch.place(self._law.at(self.time)[0])
        stretch = self._path.backwards(place, self._seen) if self._backwards else self._path.forwards
        if stretch is None:
            return
        s = (place - stretch.start) * stretch.direction
        self._stretch, self._law = stretch, stretch.laws.steady(s, 0.0, self.time)
        self._aim()

    def _take_over(self, coming: NextPath) -> None:
        self._next = None
        if coming.number and self._planning is not None:
            if self._held != "waiting":
                return
            self._held, self._reason, self._planning.number = "", "", coming.number
        path, then = coming.path, coming.then
        self._missed = self._due(self._stretch.place(self._stretch.laws.set_point(self._law, then).place.s))
        self._path, self._stretch, self._stops, self._detour = path, path.forwards, JointStops(path), None
        self._scene = self._scene.over(path, coming.since, coming.watch)
        self._seen, self._backwards = -math.inf, False
        self._wanted = 0.0 if self._held else self._override
        self._law = self._first_law(path, self._wanted, then)
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

    def _status(self, at: PathPlace) -> Status:
        T, place, resting = self._path.motion.duration, self._stretch.place(at.s), at.speed == 0.0
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
        speed, off = self._stretch.direction * at.speed, self._detour is not None
        return Status(phase, place, place / T, speed, self._override, self._reason, self._tracking.deviation, off)
