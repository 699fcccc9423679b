"""`Executor`: the set-points of a verified run, one a tick, at a speed that changes on the way."""

import weakref
from collections import deque
from collections.abc import Mapping
from functools import partial
from typing import TYPE_CHECKING

from optiplan.arrays import Array, number_argument
from optiplan.errors import described, wrong_argument
from optiplan.execution import arguments
from optiplan.execution.due_events import DueEvents
from optiplan.execution.law_follower import DROPPED, LawFollower
from optiplan.execution.paths.joint_stop import Detour, JointStops
from optiplan.execution.paths.next_path import NextPath, spliced_path
from optiplan.execution.paths.path_laws import SetPoint
from optiplan.execution.paths.proved_path import PathStretch, ProvedPath, Turned
from optiplan.execution.paths.stop_ahead import way_ahead
from optiplan.execution.scene.planning_process import PlanningProcess
from optiplan.execution.scene.policy import Policy, Reaction
from optiplan.execution.scene.scene_watch import BlockedPlace, SceneWatch
from optiplan.execution.scene.seen_scene import SceneUpdate, SeenScene
from optiplan.execution.scene.separation import Separation, SeparationMonitor
from optiplan.execution.status import Ahead, Held, Status, Stopping, Tick, phase_of
from optiplan.execution.tracking_monitor import TrackingMonitor, TrackingPolicy
from optiplan.geometry.pose import Values
from optiplan.runs.run import Run
from optiplan.trajectory.segments import Segment
from optiplan.trajectory.state import State

if TYPE_CHECKING:
    from optiplan._core._core_base import TimeLaw

TOO_LATE = "the stop comes too late"
"""What a reason says where the robot would not stand still in time."""

KEPT_STATES = 64
"""Predicted states that a splice may begin at."""

STOP_PLACES = 200
"""Places of a motion for which `stopping` gives the stop."""


class Executor(LawFollower):
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
        policy: what is done where they block the path: an `op.Policy`, or the name of its reaction.
        separation: people to keep apart from: the robot then moves only as fast, and as long, as `update_scene` reports
            them.

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
        tracking: TrackingPolicy | None = None,
        policy: Policy | Reaction = "wait",
        separation: Separation | None = None,
    ) -> None:
        arguments.checked_arguments(run, override, deviation, clearance)
        if tracking is not None and not isinstance(tracking, TrackingPolicy):
            raise wrong_argument("Executor", "tracking", described(tracking), "an op.TrackingPolicy(…), or None")
        self._path = ProvedPath(run, "Executor")
        self._policy = Policy.of(policy, separation)
        watch = SceneWatch(self._path, float(clearance), self._policy.linger)
        people = None if separation is None else SeparationMonitor(self._path, watch, separation)
        self._scene = SeenScene(watch, people)
        self._planning: PlanningProcess | None = None
        if self._policy.reaction != "wait":
            watch.prepare(self._path.forwards)
        self._tracking = TrackingMonitor(self._path, deviation, tracking or TrackingPolicy())
        if self._policy.reaction == "replan":
            self._planning = PlanningProcess.of(run, watch, self._policy, self._tracking.prepare)
            self._leave = weakref.finalize(self, self._planning.leave)  # is called once
        self._stretch: PathStretch = self._path.forwards
        self._stops = JointStops(self._path)
        self._stops.prepare()
        self._detour: Detour | None = None
        self.time = 0.0
        self._override = self._wanted = float(override)
        self._law: TimeLaw = self._start_law(self._path, float(override), 0.0)
        self._held: Held = "" if override > 0.0 else "paused"
        self._reason, self._blocking = "", None
        self._events = DueEvents(self._path)
        self._turned: Turned | None = None  # what follows the law, if the robot is to turn
        self._predicted: deque[tuple[float, State, TimeLaw]] = deque(maxlen=KEPT_STATES)
        self._next: NextPath | None = None
        self._pending = False
        self._backwards = False
        if self._law.target != override:  # it begins in motion
            self._aim()

    @property
    def run(self) -> Run:
        """The run that is being executed."""
        return self._path.run

    @property
    def allowed(self) -> Array:
        """(n,) rad or m: how far each measured joint may be from the path; inf: anything."""
        return self._tracking.allowed

    @property
    def override(self) -> float:
        """Speed that is wanted, 0 to 1 of the planned motion's; set it at any time."""
        return self._override

    @override.setter
    def override(self, speed: float) -> None:
        if not arguments.is_share(speed):
            self.stop(f"override: found {described(speed)}; expected a speed from 0 to 1")
            return
        if speed != self._override:  # said again, it changes nothing
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
        self._held, self._next, self._blocking = "stopped", None, None
        self._reason, off = arguments.stop_words(reason, how)
        self._aim()
        if off and self._detour is None and self._people is None and not self._rests:
            self._detour = self._stops.leave(self._stretch, self._law, self.time, self._scene)
            if self._detour is not None:
                self._stretch, self._law, self._pending = self._detour.stop, self._detour.law, False

    def resume(self) -> None:
        """Go on with the speed of `override`, forwards."""
        self._held, self._reason, self._backwards = "", "", False
        self._aim()

    def reverse(self) -> None:
        """Stop, and go back along the path at the speed of `override`, to the last event of a task or the start."""
        self._held, self._reason, self._backwards = "", "", True
        self._aim()

    def update_scene(
        self, poses: SceneUpdate, velocities: Mapping[str, Values] | None = None, spread: float = 0.0, age: float = 0.0
    ) -> None:
        """Obstacles have moved, appeared or vanished: check the rest of the path against them, now.

        Where they block it, the policy decides: by default the robot stops along the path and waits; a later update
        that leaves the path clear lets it go on. Beside people of `separation` it goes on as fast as the separation
        allows, now. Nothing raises here: an update that cannot be used ends in a stop.

        Args:
            poses: by name: the pose of a known obstacle, another one (`op.Sphere(…)` …), or None for one that is gone.
            velocities: (3,) m/s, of the frames of some of them; the others stand still.
            spread: m/s; how fast they may depart from that course, in any direction.
            age: s since they were there.
        """
        place = self._stretch.place(self._law.at(self.time)[0])
        reason = self._scene.see(poses, {} if velocities is None else velocities, spread, self.time, place, age)
        if reason:
            self.stop(reason)
            return
        if self.time == 0.0:
            self.prepare()
        self._heed()
        if self._held == "waiting" and self._next is None:
            ahead: TimeLaw | None = self._law
            if self._detour is None:
                ahead = self._stretch.laws.change_along(self._law, self.time, self._override)
            if ahead is not None and self._blocked(ahead, 0.0 if self._rests else self._policy.spare) is None:
                self._held, self._reason = "", ""
                self._aim()
                return
        self._yield()

    def _blocked(self, law: "TimeLaw", spare: float = 0.0) -> BlockedPlace | None:
        return self._scene.blocked(self._stretch, law, self.time, spare)

    def _yield(self) -> None:
        """Do as the policy says, where obstacles that were seen block the way of the law."""
        found, coming = self._blocked(self._way), self._next
        if coming is not None and (found is None or self._leaves_first(coming, found)):
            return
        begins = found is not None and not self._held
        if found is not None and begins:
            self._held = "stopped" if self._policy.reaction == "stop" else "waiting"
            self._reason, self._blocking = str(found), found.pair
        if begins or (self._held == "waiting" and (found or self._policy.reaction == "slow")):
            self._next = None
            if coming is not None and not coming.number:
                self._reason += f"; {DROPPED}"
            self._avoid()
            found = self._blocked(self._way)
        if found is not None and not self._rests and TOO_LATE not in self._reason:
            self._reason = f"{self._reason or found}; {TOO_LATE}"

    def _avoid(self) -> None:
        """Follow a law that is clear until the robot stands still, or stop now."""
        clear = None
        if self._policy.goes_on and self._detour is None:
            blocked = partial(self._blocked, spare=self._policy.spare)
            clear = self._policy.law(self._stretch.laws, self._law, self.time, self._override, blocked)
        if clear is None:
            self._lead()
        else:
            self._law = self._chosen = clear
            self._wanted, self._pending = 0.0, False

    def _accept(self, planning: PlanningProcess) -> None:
        """Let a path of the policy take over, if it came in time and is clear; ask for one until there is one."""
        if planning.lost:
            self._planning = None
            self.stop("the planning process has ended")
            return
        coming = planning.answer(self._law, self.time)
        if self._held != "waiting" or self._next is not None:
            return
        if coming is not None and not self._blocked_next(coming, self._policy.spare):
            self._next = coming
        elif not self._backwards:
            planning.seek(self._law, self.time, self._state_at, self._scene)

    def state_in(self, latency: float) -> State:
        """Return the state of the robot `latency` s from now, if nothing is changed until then.

        A motion that is planned from it can be handed to `splice`.

        Raises:
            InputError: the latency is no number of seconds >= 0.
        """
        then = self.time + number_argument("Executor.state_in", "latency", latency, "seconds >= 0", 0.0)
        state = self._state_at(then)
        self._predicted.append((then, state, self._law))
        return state

    def ahead(self, lead: float) -> Ahead:
        """Return the next `lead` s, if nothing is changed, and the stop along the path from there, for a driver."""
        lead = number_argument("Executor.ahead", "lead", lead, "seconds >= 0", 0.0)
        return way_ahead(self._stretch.laws, self._law, self.time, lead)

    def is_along(self, ahead: Ahead) -> bool:
        """Whether the law is still the one that leads to `ahead`."""
        return self._law is ahead.along

    def follow(self, ahead: Ahead, reason: str) -> None:
        """Take over the way of a robot that follows `ahead`, along which the law leads, and its stop, by itself."""
        self._held, self._reason, self._next, self._pending = "stopped", reason, None, False
        self._law, self._turned = ahead.along if ahead.law is ahead.along else ahead.along.then(ahead.law), None

    def coast(self, duration: float) -> tuple[Segment, ...]:
        """Go on along the law for `duration`, s, as a robot did that got no set-points; return the events on the way.

        Nothing takes over or turns meanwhile: the robot would not know.

        Raises:
            InputError: the duration is no number from 0 to `LONGEST_COAST`.
        """
        end, events, self._turned = self.time + arguments.coasted(duration), tuple[Segment, ...](), None
        if self._detour is not None:
            self._detour.drop()
        while (now := self.time) < end:
            rests = self._rests
            self.time = end if rests else min(end, now + arguments.LONGEST_TICK)
            if not rests:
                self._note_way(self.time)
            point = self._point()
            place = self._stretch.place(point.place.s)
            self._tracking.tick(None, now, self.time, point.q, place, on_path=self._detour is None)
            events += self._events.by(place)
        return events

    def splice(self, run: Run | SceneWatch) -> bool:
        """Let another verified run take over where it begins: in a state that `state_in` returned.

        Position, velocity and acceleration are continuous there. Where the run comes too late, where it is not
        verified, or where the speed is changed between the prediction of its state and its begin, the robot stops along
        its path instead. What `prepare_path` made of the run takes no time here.

        Returns:
            Whether the run takes over.
        """
        states = [(then, state) for then, state, law in self._predicted if law is self._law]
        standing = self._state_at(self.time) if self._rests else None
        beside = self._people is not None
        watch = run if isinstance(run, SceneWatch) else None
        given: Run | ProvedPath = run.path if isinstance(run, SceneWatch) else run
        found = spliced_path(given, self.run, states, standing, self.time, self._policy, at_rest_only=beside)
        if isinstance(found, str):
            self.stop(found)
            return False
        self._tracking.prepare(found.path)
        coming = found._replace(watch=watch or self._scene.watch_over(found.path))
        fault = self._misfit(coming)
        if fault:
            self.stop(fault)
            return False
        self._next = coming
        return True

    def tick(self, dt: float, measured: object = None) -> Tick:
        """Return the set-point `dt` s after the last one.

        Nothing raises here: what cannot be, such as a time that runs backwards, ends in a stop along the path.

        Args:
            dt: s since the last tick.
            measured: positions of the joints (n,), rad or m, a `State` or a `Measurement`; None: not measured.
        """
        step, reason = arguments.checked_step(dt)
        if reason:
            self.stop(reason)
        if self._planning is not None:
            self._accept(self._planning)
        now, end = self.time, self.time + step
        if self._next is not None and end >= self._next.then:
            self._take_over(self._next)
        self.time = end
        self._note_way(self.time)
        if self._pending and self._replace_law():
            self._yield()
        before = None
        while self._rests and self._law is not before:  # a way back may be over within the tick in which it begins
            before = self._law
            self._turn()
            self._note_way(self.time)
        point = self._point()
        place = self._stretch.place(point.place.s)
        reason = self._tracking.tick(measured, now, self.time, point.q, place, on_path=self._detour is None)
        if reason and self._held != "stopped":
            self.stop(reason)
        return Tick(self.time, point.q, point.v, point.a, point.torque, self._events.by(place), self._status(point))

    def prepare(self) -> None:
        """Make what `update_scene` and then `reverse` need, which takes 3 to 70 ms; else their first calls do."""
        for stretch in (self._stretch, self._path.first_way_back):
            if stretch is not None:
                self._scene.prepare(stretch, at_once=True)

    def prepare_path(self, path: ProvedPath) -> SceneWatch:
        """Return what `splice` needs of a path, from any thread, which takes milliseconds; else `splice` makes it."""
        self._tracking.prepare(path)
        return self._scene.watch_over(path, at_once=True)

    def close(self) -> None:
        """Leave the process that plans, if the policy has one, to the next run; else it ends with the executor."""
        self._planning = None
        if self._policy.reaction == "replan":
            self._leave()

    @property
    def status(self) -> Status:
        """What the executor is doing at the last tick."""
        return self._status(self._point())

    def stopping(self, places: int = STOP_PLACES) -> Stopping:
        """Return the stop along the path from full speed, at equally spaced places of the motion, at least one."""
        return self._path.forwards.laws.stopping(places)

    def _status(self, point: SetPoint) -> Status:
        place, T = self._stretch.place(point.place.s), self._path.motion.duration
        speed, people = self._stretch.direction * point.place.speed, self._scene.people
        reason = self._reason or ("" if people is None or place >= T else people.reason(self.time))
        changes = self.time < self._way.settled or self._pending
        resting = point.place.speed == 0.0
        ends = place >= T and resting and self._next is None  # it may turn there
        phase = "done" if ends else phase_of(self._held, resting, changes)
        if not self._held and people is not None and speed == 0.0 and self._wanted > 0.0 and place < T:
            phase = "waiting"
        return Status(
            phase=phase,
            place=place,
            progress=place / T,
            speed=speed,
            override=self._override,
            reason=reason,
            deviation=self._tracking.deviation,
            lag=self._tracking.lag,
            clearance=self._tracking.clearance,
            separation=None if people is None else people.kept,
            off_path=self._detour is not None,
            blocked_by=self._blocking if self._held in ("waiting", "stopped") else None,
        )
