"""The loop that asks an executor for a set-point at each tick of a driver, and what it does when a tick comes late."""

import math
import queue
import time
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from typing import Protocol

from optiplan.execution.drivers.base import Capabilities, Driver
from optiplan.execution.executor import LONGEST_TICK, Executor
from optiplan.execution.measurement import Measurement
from optiplan.execution.status import Ahead, Tick
from optiplan.trajectory.segments import Segment

PATIENCE = 0.01
"""s: a set-point that comes later than this ends in a stop."""

SETTLE = 0.1
"""s: for so long the last set-point is sent again before the driver is let go."""

WITHOUT_STATE = 0.2
"""s: for so long a driver that measures may have no state."""

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

    Attributes:
        tick: the last set-point; None before the first.
        measured: the last state; None where there is none.
        events: of tasks, done so far.
        missed: ticks that were left out.
        longest: time between two set-points at most, s.
        lateness: of the last ticks, s.
        beat: time.monotonic at the last tick, s.
        ended: whether no further set-point is sent.
    """

    def __init__(
        self,
        executor: Executor,
        driver: Driver,
        capabilities: Capabilities,
        clock: TickClock,
        commands: "queue.SimpleQueue[Callable[[], None]]",
    ) -> None:
        self._executor, self._driver, self._commands = executor, driver, commands
        self._clock, self._period, self._lead = clock, 1.0 / capabilities.rate, capabilities.lead
        self._reads = capabilities.measures
        self._ahead: Ahead | None = None
        self._fresh: Ahead | None = None  # not sent yet
        self._still = 0.0  # s that the robot has stood at the end
        self._unseen = 0.0  # s without a state
        self.tick: Tick | None = None
        self.measured: Measurement | None = None
        self.events: list[Segment] = []
        self.missed, self.longest, self.beat = 0, 0.0, time.monotonic()
        self.lateness: deque[float] = deque(maxlen=KEPT_LATENESS)
        self.ended = False

    def run(self) -> str:
        """Send set-points until the robot stands still at the end or after a stop; return why that was at once.

        Returns:
            Empty where the motion came to its end or its stop; else why no further set-point could be sent.
        """
        due = before = self._clock.now()
        step, passed = 0.0, 0.0
        while not self.ended:
            self.beat = time.monotonic()
            refused = self._tick(step, passed)
            if refused or self._over(step):
                return refused
            self._look_ahead()
            due += self._period
            self._clock.sleep_until(due)
            now = self._clock.now()
            passed, late = now - before, now - due
            if passed < 0.0 or not math.isfinite(passed):
                self._executor.stop(f"the clock ran backwards by {-passed:.3f} s")
                due, step = now, 0.0
            else:
                left_out = int(late / self._period)
                due += left_out * self._period
                self.missed += left_out
                self.longest = max(self.longest, passed)
                self.lateness.append(late)
                step = self._step(left_out, late)
                if self._lead == 0.0 and late > LONGEST_TICK:
                    return f"no set-point for {passed:.3f} s: the robot is where its drives left it"
            before = now
        return ""

    def _step(self, left_out: int, late: float) -> float:
        """Return how far the law goes on, s; a long silence ends in a stop.

        A robot that gets single set-points waits for the next one: it is the one after the last, whenever it comes.
        One with a way ahead has gone on meanwhile.
        """
        if late > PATIENCE and not self._executor.status.phase == "done":
            self._executor.stop(f"a set-point came {1e3 * late:.1f} ms late")
        return self._period * (1 + left_out) if self._lead else self._period

    def _tick(self, step: float, passed: float) -> str:
        """Take commands, read the state, send a set-point; return why that was not possible."""
        while not self._commands.empty():
            self._commands.get()()
        events = self._catch_up(step)
        self.measured = self._state(step)
        tick = self._executor.tick(self._rest, self.measured)
        if events:
            tick = replace(tick, events=(*events, *tick.events))
        if self._fresh is not None:
            tick, self._ahead, self._fresh = replace(tick, ahead=self._fresh), self._fresh, None
        try:
            self._driver.send(tick)
        except Exception as error:  # whatever a driver raises, the robot is to stand still
            return f"the driver takes no set-point: {_text(error)}"
        self.events += tick.events
        self.tick = tick
        return ""
