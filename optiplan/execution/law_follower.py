"""`LawFollower`: a robot on its way along a path, and the laws that it follows from one to the next."""

from typing import TYPE_CHECKING

from optiplan.errors import OfOneProcess
from optiplan.execution.arguments import same_state
from optiplan.execution.due_events import DueEvents
from optiplan.execution.paths.joint_stop import Detour, JointStops
from optiplan.execution.paths.next_path import NextPath
from optiplan.execution.paths.path_laws import SetPoint, rests
from optiplan.execution.paths.proved_path import PathStretch, ProvedPath, Turned, held_in
from optiplan.execution.scene.planning_process import PlanningProcess
from optiplan.execution.scene.scene_watch import BlockedPlace
from optiplan.execution.scene.seen_scene import SeenScene
from optiplan.execution.scene.separation import SeparationMonitor
from optiplan.execution.status import Held
from optiplan.execution.tracking_monitor import TrackingMonitor
from optiplan.trajectory.state import State

if TYPE_CHECKING:
    from optiplan._core._core_base import TimeLaw

BLOCKED = "obstacles block the motion that was to take over"
"""What a reason says where not even a stop is clear that begins with it."""

DROPPED = "the motion that was to take over is dropped"
"""What a reason says where obstacles block the way to that motion, or the last stop before it."""

ELSEWHERE = "the speed was changed before another motion could take over"
"""What a reason says where another motion begins in a state that the robot does not come to."""


class LawFollower(OfOneProcess):
    """What `Executor` knows of its way, and how it changes its law.

    At all times there is a law until the robot stands still. A change replaces it only by another such law.
    """

    time: float
    _path: ProvedPath
    _stretch: PathStretch
    _law: "TimeLaw"
    _chosen: "TimeLaw | None" = None  # a law of the policy, which may go on for a while before it stops
    _override: float
    _wanted: float  # speed that the law is to lead to
    _pending: bool  # whether it does not yet
    _held: Held
    _backwards: bool
    _turned: Turned | None  # what follows the law, if the robot is to turn
    _detour: Detour | None
    _next: NextPath | None
    _events: DueEvents
    _scene: SeenScene
    _stops: JointStops
    _tracking: TrackingMonitor
    _planning: PlanningProcess | None
    _reason: str
    _blocking: tuple[str, str] | None  # the bodies for which the robot stopped by itself last

    def __repr__(self) -> str:
        """The run, and how long it is being executed."""
        return f"{type(self).__name__}: {self._path.run!r}; {self.time:.3f} s since the first tick"

    @property
    def _people(self) -> SeparationMonitor | None:
        return self._scene.people

    def stop(self, reason: str = "", how: str = "path") -> None:
        """Stop, for a reason."""
        raise NotImplementedError

    def _yield(self) -> None:
        """Do what is to be done where obstacles block the way of the law."""
        raise NotImplementedError

    def hold(self, duration: float) -> None:
        """Let a time, s, pass in which the robot held its set-point, as no other came: what was seen grows older."""
        self._tracking.age(duration)
        if self._scene.age(duration):
            self._heed()
            self._yield()

    def _heed(self) -> None:
        """Choose again beside people, and forget what was found clear of what was seen before."""
        if self._scene.people is not None:
            self._lead()
        self._turned = None
        if self._detour is not None:
            self._detour.forget()
        self._look_beyond()

    def _blocked_next(self, coming: NextPath, spare: float = 0.0) -> bool:
        law = self._start_law(coming.path, self._override, coming.then)
        return self._scene.over(coming).blocked(coming.path.forwards, law, coming.then, spare) is not None

    def _look_beyond(self) -> None:
        """Drop a path that is to take over, if what was seen blocks it; the robot stops if that was `splice`'s."""
        if self._next is None:
            return
        if self._next.number and self._blocked_next(self._next):
            self._next = None
        elif not self._next.number and not self._enters(self._next):
            self.stop(BLOCKED)

    def _leaves_first(self, coming: NextPath, found: BlockedPlace) -> bool:
        """Whether the robot is to go on to the path that takes over, which is clear, though its law is blocked.

        The law is replaced by one that is the same until then, and ends in a stop, if that is clear. If it is not, nor
        a stop at once, the path that takes over is the only way that is clear.
        """
        if self._rests:
            return True
        laws, then = self._stretch.laws, coming.then
        later = laws.then_stop(self._law, then)
        if self._detour is None and self._scene.blocked(self._stretch, later, self.time) is None:
            self._law = self._chosen = later
            return True
        until = self._stretch.place(self._law.at(then)[0])
        if self._stretch.direction * (found.place - until) <= 0.0:
            return False
        stop = laws.then_stop(self._law, self.time)
        return coming.number > 0 or self._scene.blocked(self._stretch, stop, self.time) is not None

    def _misfit(self, coming: NextPath) -> str:
        """Return why the path of `splice` may not take over, or nothing."""
        place = self._stretch.place(self._law.at(coming.then)[0])
        held, taken = self._path.held_at(place), held_in(coming.path.run.problem.scene)
        if held != taken:
            there, here = (", ".join(sorted(name for name, _ in of)) or "nothing" for of in (held, taken))
            return f"the motion that was to take over begins with {here} in hand; the robot will hold {there}"
        return "" if self._enters(coming) else BLOCKED

    def _enters(self, coming: NextPath) -> bool:
        """Whether what was seen leaves the path that takes over clear, or at least a stop that begins with it."""
        seen, stretch, then = self._scene.over(coming), coming.path.forwards, coming.then
        law = self._start_law(coming.path, self._override, then)
        return any(seen.blocked(stretch, one, then) is None for one in (law, stretch.laws.then_stop(law, then)))

    def _take_over(self, coming: NextPath) -> None:
        """Go on, from then, along the path that was to take over, if the robot comes to where that begins."""
        self._next = None
        if coming.number and self._held != "waiting":
            return
        path, then = coming.path, coming.then
        if then < self.time or not same_state(self._state_at(then), path.run.problem.start_state):
            self.stop(ELSEWHERE)  # whatever led elsewhere
            return
        self._note_way(then)
        self._events = self._events.then(path, self._stretch.place(self._law.at(then)[0]))
        self._path, self._stretch = path, path.forwards
        self._scene, self._stops, self._detour = self._scene.over(coming), JointStops(path), None
        if self._held == "waiting":  # for what blocks the path that was left
            self._held, self._reason, self._blocking = "", "", None
        if self._planning is not None:
            self._planning.follow(path.run, self._scene.watch, coming.number)
        self._tracking.take_over(path)
        self._backwards, self.time = False, then  # the law of the path does not begin before
        self._law = self._start_law(path, 0.0 if self._held else self._override, then)
        self._lead()
        self._yield()

    def _start_law(self, path: ProvedPath, speed: float, then: float) -> "TimeLaw":
        """Return the law at the start of a motion: at rest any speed will do, in motion that of the plan.

        Beside people the robot waits until the first data about them are there.
        """
        speed = 0.0 if self._people is not None else speed
        return path.forwards.laws.steady(0.0, speed if path.starts_at_rest else 1.0, then)

    @property
    def _way(self) -> "TimeLaw":
        """The law, without the stop that follows if no more data about people come."""
        return self._law if self._people is None else self._people.way(self._law, self.time)

    @property
    def _rests(self) -> bool:
        """Whether the robot stands still, and will: also at the end of its path, whatever the law."""
        return self._law_rests or self._law.at(self.time)[0] >= self._stretch.laws.length

    @property
    def _law_rests(self) -> bool:
        """Whether the law leads to rest and has come to it."""
        return rests(self._law, self.time)

    def _aim(self) -> None:
        """Let the law lead to the wanted speed, at once or as soon as limits leave room for it."""
        if self._lead():
            self._yield()

    def _lead(self) -> bool:
        """See `_aim`; return whether there is another law."""
        self._turned = None
        if self._detour is not None:
            return self._steer(self._detour)
        self._wanted = 0.0 if self._held or self._turns else self._override
        replaced = self._replace_law()
        if self._turns and self._rests:
            self._turn()
        elif self._turns and self._law.target == 0.0 and not self._held and self._people is None:
            self._turned = self._next_stretch(self._law.settled)
        return replaced

    def _steer(self, detour: Detour) -> bool:
        """See `_lead`, off the path; return whether there is another law, which is still to be checked."""
        before, speed = self._law, 0.0 if self._held else self._override
        if speed > 0.0:
            self._scene.prepare(detour.back)
        onward = detour.steer(self._stretch, before, self.time, speed, self._scene)
        self._stretch, self._law, self._pending = onward.stretch, onward.law, False
        if self._stretch is detour.left:
            self._detour = None
            return self._lead() or not onward.clear
        return self._law is not before and not onward.clear

    def _replace_law(self) -> bool:
        """Replace the law by one that leads to the wanted speed, and return True; it stays while there is none."""
        s = self._law.at(self.time)[0]
        length = self._stretch.laws.length
        if s >= length:  # at its end the robot stands still, whatever the law
            if not self._law_rests:
                self._law = self._stretch.laws.steady(length, 0.0, self.time)
            self._pending = False
            if self._people is not None:
                self._people.choose(self._stretch, self._law, self.time, 0.0)
            return False
        if self._people is not None:
            self._pending = False  # until the next data
            kept = self._people.choose(self._stretch, self._law, self.time, self._wanted)
            return kept is not None and self._follow(kept)
        if self._law.target == self._wanted and self._law is not self._chosen:  # it is on its way there
            self._pending = False
            return False
        self._pending = True
        law = self._stretch.laws.change_along(self._law, self.time, self._wanted)
        if law is None:
            return False
        self._pending = law.target != self._wanted and law.at(law.settled)[0] < length
        return self._follow(law)

    def _follow(self, law: "TimeLaw") -> bool:
        self._law = law
        coming, self._next = self._next, None  # it was to begin in a state that the robot does not come to any more
        if coming is not None and not coming.number:  # that of the policy is planned again
            self.stop(ELSEWHERE)
        return True

    def _turn(self) -> None:
        """Change the direction of a robot that stands still, if that is wanted."""
        if self._detour is not None:
            if self._steer(self._detour):
                self._yield()
            return
        if self._held or not self._turns:
            return
        if self._law.target != 0.0:  # it came to the end of its path before it could stop
            self._replace_law()
        turned, self._turned = self._turned, None
        if turned is None or turned.begin != self._law.settled:
            turned = self._next_stretch(self.time)
        if turned is not None:
            self._stretch, self._law = turned.stretch, turned.law
            self._lead()
            if not turned.clear:
                self._yield()

    @property
    def _turns(self) -> bool:
        """Whether the robot is to go the other way."""
        return self._backwards != (self._stretch.direction < 0.0)

    def _next_stretch(self, then: float) -> Turned | None:
        """Return the way in the other direction from where the robot will rest."""
        place = self._stretch.place(self._law.at(then)[0])
        speed = 0.0 if self._people is not None else self._override
        turned = self._path.turned(place, then, self._backwards, self._events.done, speed)
        if turned is None or self._scene.blocked(turned.stretch, turned.law, then) is not None:
            return turned
        return turned._replace(clear=True)

    def _note_way(self, then: float) -> None:
        """Have the monitor know the way of the law up to a time, s."""
        self._tracking.pass_along(self._stretch, self._law, then, on_path=self._detour is None)

    def _point(self) -> SetPoint:
        return self._stretch.laws.set_point(self._law, self.time)

    def _state_at(self, then: float) -> State:
        """Return the state at a time, s, if nothing is changed until then."""
        point = self._stretch.laws.set_point(self._law, then)
        return State(point.q, point.v, point.a)
