"""The loop that asks an executor for a set-point at each tick of a driver, and what it does when a tick comes late."""

import math
import queue
import time
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from typing import Protocol

import numpy as np

from optiplan.arrays import Array
from optiplan.execution.arguments import LONGEST_TICK
from optiplan.execution.drivers.base import Capabilities, Driver
from optiplan.execution.executor import Executor
from optiplan.execution.loop.driver_checks import NEAR, astray, in_words, measured_by
from optiplan.execution.measurement import Measurement
from optiplan.execution.status import Ahead, Tick
from optiplan.trajectory.segments import Segment

PATIENCE = 0.01
"""s: a set-point that comes as late as this ends in a stop."""

SETTLE = 0.1
"""s: for so long the last set-point is sent again before the driver is let go."""

ARRIVES_IN = 1.0
"""s: for so long, beyond the driver's latency, the last set-point is sent again to a robot that is not at the end."""

KEPT_LATENESS = 100_000
"""Ticks whose lateness is kept, the last ones."""


class TickClock(Protocol):
    """The clock of a loop; another one in tests."""

    def now(self) -> float:
        """Seconds since some time."""

    def sleep_until(self, t: float) -> None:
        """Return at `t`, or at once where that is over."""


class MonotonicClock:
    """The clock of this machine that no one sets."""

    def now(self) -> float:
        """Seconds of `time.monotonic`."""
        return time.monotonic()

    def sleep_until(self, t: float) -> None:
        """Return at `t`, or at once where that is over."""
        time.sleep(max(0.0, t - time.monotonic()))


class TickLoop:
    """One set-point a period, on a grid of times; see docs/how-to/drivers.md for what happens to late ones.

    Args:
        executor: of the motion; nothing else may call it meanwhile.
        driver: that gets the set-points.
        capabilities: of the driver.
        clock: that gives the time.
        commands: calls to make between two ticks; they raise nothing.
        patience: how late a set-point may come, s, before the robot stops.

    Attributes:
        tick: the last set-point; None before the first.
        measured: the last state; None where there is none.
        events: of tasks, done so far.
        missed: ticks that were left out.
        longest: time between two set-points at most, s.
        lateness: of the last ticks, s.
        beat: time.monotonic at the last tick, s.
        ended: whether no further set-point is sent.
        turns: (n,) rad, whole ones by which the robot counts its endless joints farther than the motion; None: it does
            not.
    """

    def __init__(
        self,
        executor: Executor,
        driver: Driver,
        capabilities: Capabilities,
        clock: TickClock,
        commands: "queue.SimpleQueue[Callable[[], None]]",
        patience: float = PATIENCE,
    ) -> None:
        self._waits = capabilities.waits
        self._patience = math.inf if capabilities.waits else patience
        self._silence = math.inf if capabilities.waits or capabilities.lead else LONGEST_TICK
        self._executor, self._driver, self._commands = executor, driver, commands
        self._clock, self._period, self._lead = clock, 1.0 / capabilities.rate, capabilities.lead
        self._reads, self._latency = capabilities.measures, capabilities.latency
        self._names = capabilities.joint_names if capabilities.measures else ()
        self._ahead: Ahead | None = None
        self._fresh: Ahead | None = None  # not sent yet
        self._still = 0.0  # s that the robot has stood at the end
        self.tick: Tick | None = None
        self.measured: Measurement | None = None
        self.events: list[Segment] = []
        self.missed, self.longest, self.beat = 0, 0.0, time.monotonic()
        self.lateness: deque[float] = deque(maxlen=KEPT_LATENESS)
        self.ended, self._begun = False, -math.inf
        self.turns: Array | None = None

    def run(self) -> str:
        """Send set-points until the robot stands still at the end or after a stop; return why that was at once.

        Returns:
            Empty where the motion came to its end or its stop; else why no further set-point could be sent.
        """
        due = before = self._clock.now()
        refused = self._tick(0.0, 0.0, 0.0)
        while not refused and not self._over():
            self._look_ahead()
            due += self._period
            self._clock.sleep_until(due)
            now = self._clock.now()
            self.beat = time.monotonic()
            if now < before:
                self._stop(f"the clock ran backwards by {before - now:.3f} s")
                due = now
            left_out = max(0, int((now - due) / self._period))
            late, due = now - due, due + left_out * self._period
            self.missed, self.longest = self.missed + left_out, max(self.longest, now - before)
            self.lateness.append(late)
            before = now
            if late > self._silence:
                return f"no set-point for {late:.3f} s: the robot is where its drives left it"
            self._begun = due - self._period
            refused = self._tick(self._period, left_out * self._period, late)
        return refused or self._missed_end()

    def waited(self, since: float) -> float:
        """Return how long before the executor's time a command was given, s, that is taken now."""
        return 0.0 if self._waits else max(0.0, self._begun - since)

    def _tick(self, step: float, left_out: float, late: float) -> str:
        """Take commands, read the state, send a set-point; return why that was not possible."""
        end, events = self._executor.time + step + (left_out if self._lead else 0.0), self._catch_up(left_out)
        if late >= self._patience:
            self._stop(f"a set-point came {1e3 * late:.0f} ms late")
        while not self._commands.empty():
            self._commands.get()()
        self.measured = self._state()
        tick = self._executor.tick(max(0.0, end - self._executor.time), self.measured)
        if self._lead and not (self._ahead is not None and self._executor.is_along(self._ahead)):
            self._fresh = self._executor.ahead(self._lead)
        if events or self._fresh is not None:
            tick = replace(tick, events=(*events, *tick.events), ahead=self._fresh)
        if self.ended:  # while the state was read
            return "ended"
        try:
            self._driver.send(tick if self.turns is None else _turned(tick, self.turns))
        except BaseException as error:  # whatever a driver raises, the robot is to stand still
            return f"the driver takes no set-point: {in_words(error)}"
        self._ahead, self._fresh = self._fresh or self._ahead, None
        self.events += tick.events
        self.tick = tick
        return "ended" if self.ended else ""

    def _catch_up(self, left_out: float) -> tuple[Segment, ...]:
        """Let the time of ticks that were left out pass, s; return events.

        With a lead the robot has gone on along its way ahead meanwhile. Others have held their set-point, and only what
        was seen is older.
        """
        step, ahead = left_out + self._period, self._ahead
        if ahead is not None and self._executor.time + step > ahead.turn:
            self._executor.follow(ahead, f"no set-point for {1e3 * step:.0f} ms: the driver began the stop")
        if self._lead and left_out > 0.0:
            return self._executor.coast(left_out)
        if left_out > 0.0 and not self._waits:
            self._executor.hold(left_out)
        return ()

    def _look_ahead(self) -> None:
        """Renew the way ahead in good time, after the set-point was sent; it goes with the next one."""
        then = self._executor.time + self._period
        if self._lead and self._ahead is not None and then > self._ahead.t[0] + 0.5 * self._lead:
            self._fresh = self._executor.ahead(self._lead)

    def _state(self) -> Measurement | None:
        """Return the driver's state; a driver that has none any more ends in a stop."""
        if not self._reads:
            return None
        try:
            return measured_by(self._driver)
        except BaseException as error:  # set-points can still be sent: the robot stops along the path
            self._reads = False
            self._stop(f"the driver has no state: {in_words(error)}")
            return None

    def _stop(self, reason: str) -> None:
        """Stop along the path, for the first reason that there is."""
        if self._executor.status.phase not in ("stopping", "stopped", "done"):
            self._executor.stop(reason)

    def _over(self) -> bool:
        """Whether the robot stands still for good, and has done so for a while."""
        ends = self.tick is not None and self.tick.status.phase in ("done", "stopped")
        self._still = self._still + self._period if ends else 0.0
        rested = self._still - self._latency
        return self.ended or rested > ARRIVES_IN or (rested > SETTLE and not self._missed_end())

    def _missed_end(self) -> str:
        """Return where the robot is, if the motion is done and a robot that is measured is not where it ends."""
        if not self._names or self.tick is None or self.tick.status.phase != "done":
            return ""
        if self.measured is None:
            return "the motion is done, but the driver has no state of the robot: it may be elsewhere"
        off, endless = self._executor.allowed, self._executor.run.problem.robot.endless
        near = np.where(np.isfinite(off), np.maximum(off, NEAR), NEAR)
        where = astray(self.measured, self.tick.q, endless, self._names, near)
        return where and f"the robot does not come to the end of the motion: {where}"


def _turned(tick: Tick, turns: Array) -> Tick:
    """Return a tick with the positions of q farther by whole turns (n,), rad."""
    ahead = None if tick.ahead is None else replace(tick.ahead, q=tick.ahead.q + turns)
    return replace(tick, q=tick.q + turns, ahead=ahead)
