"""`Execution`: a verified motion on a robot, in a thread of its own, steered from any other thread."""

import logging
import queue
import threading
import time
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from contextlib import suppress
from copy import deepcopy
from functools import partial
from itertools import islice
from typing import Any, TypeVar

import numpy as np

from optiplan.arrays import Array, is_finite, number_argument
from optiplan.cores import keeping_time
from optiplan.errors import OfOneProcess, described, whole_argument, wrong_argument
from optiplan.execution.arguments import LONGEST_TICK, numbers
from optiplan.execution.drivers.base import Driver, DriverError
from optiplan.execution.executor import Executor
from optiplan.execution.loop.driver_checks import astray, checked_capabilities, in_words, measured_by, whole_turns
from optiplan.execution.loop.subscribers import REPORTS, Subscribers
from optiplan.execution.loop.tick_loop import KEPT_LATENESS, PATIENCE, MonotonicClock, TickClock, TickLoop
from optiplan.execution.measurement import Measurement
from optiplan.execution.paths.proved_path import ProvedPath, rest_rates
from optiplan.execution.scene.scene_watch import SceneWatch
from optiplan.execution.scene.seen_scene import SceneUpdate
from optiplan.geometry.pose import Values
from optiplan.runs.run import Run
from optiplan.trajectory.state import State

FRESH = 0.05
"""s: so old may the state be with which a motion begins."""

FIRST_STATE = 2.0
"""s: how long to wait for the first state of a driver that measures."""

STALLED = 0.5
"""s: a call of the driver that does not return for so long is taken for its end."""

STOPPING = 10.0
"""s: the same for `stop`, in which a robot may still come to a stand."""

log = logging.getLogger(__name__)

Answer = TypeVar("Answer")


class Execution(OfOneProcess):
    """Run an executor's motion on a driver: a thread that sends a set-point a tick, to the end or to a stop.

    Commands from other threads are taken at the next tick. Nothing raises in the thread. It ends when the robot stands
    still at the end or after `stop`, or when the driver fails; the driver is then stopped. See the how-to *Drivers* for
    what is done in each case.

    Args:
        executor: that nothing else calls any more.
        driver: of a robot that stands where the motion begins.
        rate: set-points per second, Hz; None: the driver's. With a `lead`, at least three in it. Make a driver that
            holds each set-point for its own period, such as `ur_rtde`, with the same rate.
        patience: how late a set-point may come, s, before the robot stops along its path.
        clock: another one, for tests.

    Attributes:
        capabilities: of the driver, with the rate that is used.

    Raises:
        InputError: the driver has other joints, or is none; the rate cannot be.
        DriverError: the driver does not say what it can do.

    Example:
        >>> import optiplan as op
        >>> run = op.plan(op.load_problem("01_reach"))
        >>> execution = op.Execution(op.Executor(run), op.driver("sim", run, engine="own"))
        >>> execution.start()
        >>> execution.wait(20.0)["phase"]
        'done'
    """

    def __init__(
        self,
        executor: Executor,
        driver: Driver,
        *,
        rate: float | None = None,
        patience: float = PATIENCE,
        clock: TickClock | None = None,
    ) -> None:
        if not isinstance(executor, Executor):
            raise wrong_argument("Execution", "executor", described(executor), "an op.Executor(run)")
        expected = f"seconds above 0, up to {LONGEST_TICK:g}"
        number_argument("Execution", "patience", patience, expected, above=0.0, most=LONGEST_TICK)
        self._executor, self._driver = executor, driver
        self.capabilities = checked_capabilities(driver, tuple(executor.run.problem.robot.joint_names), rate)
        self._commands: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
        self._clock = clock or MonotonicClock()
        self._loop = TickLoop(executor, driver, self.capabilities, self._clock, self._commands, float(patience))
        self._lock, self._over = threading.RLock(), threading.Event()  # a signal may come while its thread holds it
        self._thread: threading.Thread | None = None
        self._begun = False
        self._failed = ""  # why it ended at once
        self._let_go = False
        self._subscribers = Subscribers(self._loop, self.snapshot, self._over)

    def __repr__(self) -> str:
        """The executor, and on what it runs."""
        return f"Execution: {self._executor!r}; on {type(self._driver).__name__}"

    def start(self) -> None:
        """Begin to send set-points.

        Raises:
            DriverError: it was started before, or the robot is not where the motion begins.
        """
        with self._lock:
            begun, self._begun = self._begun, True
        if begun:
            raise DriverError("op.Execution.start: it was started before; expected a new one for each motion")
        try:
            self._check_start()
        except BaseException as error:  # Ctrl-C, too
            self._failed = in_words(error)
            self._stop_driver("not started")
            self._over.set()
            self._start_thread(self._subscribers.report, "reports")  # the end
            raise
        with self._lock:  # a command that is being made comes to its end first
            self._loop.beat = time.monotonic()
            self._thread = threading.Thread(target=self._run, name="optiplan execution", daemon=True)
            self._thread.start()
        self._start_thread(self._watch, "watch")
        self._start_thread(self._subscribers.report, "reports")

    def wait(self, timeout: float | None = None) -> dict[str, Any]:
        """Wait until the execution is over, at most `timeout` s; return `snapshot()`.

        Raises:
            InputError: the timeout is no number of seconds >= 0, infinity or None, which are for ever.
        """
        if timeout is not None and timeout != np.inf:
            timeout = number_argument("Execution.wait", "timeout", timeout, "seconds >= 0", 0.0)
        self._over.wait(None if timeout is None else min(timeout, threading.TIMEOUT_MAX))
        return self.snapshot()

    @property
    def over(self) -> bool:
        """Whether no further set-point is sent, and the driver is let go."""
        return self._over.is_set()

    def override(self, speed: float) -> None:
        """Set the speed that is wanted, 0 to 1 of the planned motion's."""
        self._command(lambda: setattr(self._executor, "override", speed))

    def pause(self) -> None:
        """Stop along the path; `resume` goes on."""
        self._command(self._executor.pause)

    def resume(self) -> None:
        """Go on forwards, with the speed of `override`."""
        self._command(self._executor.resume)

    def reverse(self) -> None:
        """Stop, and go back along the path."""
        self._command(self._executor.reverse)

    def stop(self, reason: str = "asked to stop") -> None:
        """Stop along the path; the execution is over when the robot stands still."""
        self._command(lambda: self._executor.stop(reason))

    def update_scene(
        self, poses: SceneUpdate, velocities: Mapping[str, Values] | None = None, spread: float = 0.0, age: float = 0.0
    ) -> None:
        """Obstacles have moved, appeared or vanished; see `Executor.update_scene`. `age` grows until the tick."""
        with suppress(Exception):  # the caller may write into its own again; the executor says what cannot be
            poses = dict(poses) if isinstance(poses, Mapping) else poses
            velocities = deepcopy(velocities)
        given, update = self._clock.now(), partial(self._executor.update_scene, poses, velocities, spread)
        self._command(lambda: update(age + self._loop.waited(given) if is_finite(age) and age >= 0.0 else age))

    def state_in(self, latency: float) -> State:
        """Return the state `latency` s from now, where another motion can begin; see `Executor.state_in`.

        Raises:
            InputError: the latency is no number of seconds >= 0.
            DriverError: the execution is over.
        """
        found = self._ask(lambda: self._executor.state_in(latency))
        if found is None:
            raise DriverError("the execution is over: no other motion can take over")
        return found

    def splice(self, run: Run) -> bool:
        """Let another verified run take over; see `Executor.splice`. Its path is prepared in the calling thread."""
        given: Run | SceneWatch = run
        if isinstance(run, Run) and run.verified:
            with suppress(Exception):  # the executor finds the same, and stops with the reason
                given = self._executor.prepare_path(ProvedPath(run, "Execution.splice"))
        return bool(self._ask(lambda: self._executor.splice(given)))

    def subscribe(self, callback: Callable[[dict[str, Any]], None]) -> Callable[[], None]:
        """Have a function called with what happens, from a thread of its own.

        It gets `{"kind": "state", …}` at most 60 times a second, `{"kind": "event", "event": {…}}` for what a task
        does, and at last `{"kind": "end", …}`; states and end are as `snapshot`. One that raises is called no more.

        Returns:
            A function that ends it.

        Raises:
            InputError: it is no function.
        """
        return self._subscribers.add(callback)

    def snapshot(self) -> dict[str, Any]:
        """Return what the execution is doing, ready for JSON.

        `t` since the first tick, s; `phase`, `place`, `duration`, `progress`, `speed`, `override`, `reason`,
        `deviation`, `blocked_by` of the status (`op.Status`); `q`, `v` the last set-point and `measured` the last
        positions, lists or None, both in the turns of the motion; `age` of these, s; `events` done; `missed` ticks;
        `longest` time between two, s; `driver` and `rate`. `over` says whether it has ended.
        """
        loop, tick = self._loop, self._loop.tick
        status = self._executor.status if tick is None else tick.status
        seen = loop.measured
        return {
            "t": 0.0 if tick is None else tick.t,
            "phase": "stopped" if self._failed else status.phase,
            "place": status.place,
            "duration": self._executor.run.duration,
            "progress": status.progress,
            "speed": 0.0 if self._failed else status.speed,
            "override": status.override,
            "reason": self._failed or status.reason,
            "deviation": status.deviation,
            "blocked_by": status.blocked_by and list(status.blocked_by),
            "q": None if tick is None else tick.q.tolist(),
            "v": None if tick is None else tick.v.tolist(),
            "measured": None if seen is None else _finite(seen.q, loop.turns),
            "age": float(seen.age) if seen is not None and is_finite(seen.age) else None,
            "events": [one.to_data() for one in list(loop.events)],
            "missed": loop.missed,
            "longest": loop.longest,
            "driver": self.capabilities.name,
            "rate": self.capabilities.rate,
            "over": self.over,
        }

    def lateness(self, last: int = KEPT_LATENESS) -> dict[str, float]:
        """Return how late set-points were, s: `rms`, `p50`, `p99`, `max` of the last ticks, 100,000 unless given.

        Raises:
            InputError: `last` is no whole number >= 1.
        """
        whole_argument("Execution.lateness", "last", last, 1)
        found = None
        while found is None:
            with suppress(RuntimeError):  # a tick came in between
                found = list(islice(reversed(self._loop.lateness), last))
        late = np.abs(np.array(found or [0.0]))
        p50, p99 = np.percentile(late, [50, 99])
        return {"rms": float(np.sqrt(np.mean(late**2))), "p50": float(p50), "p99": float(p99), "max": float(late.max())}

    def _command(self, call: Callable[[], object]) -> None:
        """Have the loop make a call at its next tick; before it runs, make it now; afterwards, not at all."""
        with self._lock:
            if self._over.is_set():
                return
            if self._thread is None:
                self._guarded(call)
            else:
                self._commands.put(lambda: self._guarded(call))

    def _guarded(self, call: Callable[[], object]) -> None:
        try:
            call()
        except Exception as error:  # a command is no reason to leave the robot without set-points
            self._executor.stop(f"a command failed: {in_words(error)}")

    def _ask(self, question: Callable[[], Answer]) -> Answer | None:
        """Return the loop's answer at its next tick; None once it is over.

        Raises:
            Exception: whatever the question raises.
        """
        answer: Future[Answer | None] = Future()

        def call() -> None:
            try:
                answer.set_result(question())
            except Exception as error:
                answer.set_exception(error)

        self._command(call)
        while not answer.done() and not self._over.wait(0.0):
            try:
                return answer.result(0.05)
            except TimeoutError:
                continue
        return answer.result(0.0) if answer.done() else None

    def _check_start(self) -> None:
        """Refuse a robot that stands elsewhere: the first set-point would be a jump."""
        if not self.capabilities.measures:
            return
        begin, found = time.monotonic(), measured_by(self._driver)
        while not _is_fresh(found) and time.monotonic() < begin + FIRST_STATE:
            time.sleep(0.01)
            found = measured_by(self._driver)
        if found is None or not _is_fresh(found):
            raise DriverError(f"the driver '{self.capabilities.name}' has had no new state for {FIRST_STATE:g} s")
        begins = self.state_in(0.0)  # an executor may have come some way already
        q, start, names = numbers(found.q), begins.q, self.capabilities.joint_names
        endless = self._executor.run.problem.robot.endless
        if where := astray(found, start, endless, names):
            raise DriverError(f"the robot does not stand where the motion begins: {where}; move it there first")
        over = np.abs(begins.v) / rest_rates(self._executor.run)[0]
        if over[fastest := int(over.argmax())] > 1.0:
            speed = f"{names[fastest]} at {begins.v[fastest]:.4g} rad/s or m/s"
            raise DriverError(f"the motion begins with {speed}, and the robot stands; expected one from rest")
        turns = whole_turns(q, start, endless)
        self._loop.turns = turns if turns.any() else None

    def _run(self) -> None:
        """The thread of the set-points."""
        try:
            with keeping_time():
                refused = self._loop.run()
        except BaseException as error:  # a bug of ours: the robot is to stand still, and it is to be seen
            log.exception("the loop of an execution failed")
            refused = f"the loop failed: {in_words(error)}"
        self._loop.beat = time.monotonic()
        if not self._let_go:
            self._failed = refused
            status = self._executor.status
            self._stop_driver(refused or status.reason or status.phase)
        with self._lock:
            self._over.set()

    def _stop_driver(self, reason: str) -> None:
        """Let the driver go, once; one that raises here is reported, too."""
        self._let_go = True
        try:
            self._driver.stop(reason)
        except BaseException as error:  # also one that ends its thread: this is no reason to be over in silence
            log.warning("the driver '%s' raised at its stop: %s", self.capabilities.name, in_words(error))
            self._failed = f"{self._failed or reason}; its stop failed: {in_words(error)}"

    def _start_thread(self, target: Callable[[], None], name: str) -> None:
        threading.Thread(target=target, name=f"optiplan execution {name}", daemon=True).start()

    def _watch(self) -> None:
        """The thread that sees whether the loop still runs; it calls nobody that may keep it."""
        silent = 0
        while not self._over.wait(1.0 / REPORTS):
            most = STOPPING if self._let_go else STALLED
            silent = silent + 1 if time.monotonic() - self._loop.beat > most else 0
            if silent > 1:  # once is also seen where the whole process stood still
                self._give_up(f"the driver did not return from a call for {most:g} s")

    def _give_up(self, reason: str) -> None:
        """End without the loop, which hangs in a call of the driver."""
        again, self._loop.ended, self._failed = not self._let_go, True, reason
        if again:  # it hangs in another call than this
            stopping = threading.Thread(target=self._stop_driver, args=(reason,), daemon=True)
            stopping.start()
            stopping.join(STALLED)
        with self._lock:
            self._over.set()


def _is_fresh(found: Measurement | None) -> bool:
    return found is not None and is_finite(found.age) and found.age < FRESH


def _finite(q: Any, turns: Array | None) -> list[float | None]:
    """Return positions for JSON, which has no NaN, without the whole turns (n,), rad, that the robot is farther."""
    found = np.ravel(numbers(q))
    if turns is not None and found.shape == turns.shape:
        found = found - turns
    return [float(x) if is_finite(x) else None for x in found]
