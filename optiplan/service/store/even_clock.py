"""Whether a clock has gone evenly for so long that what is old by it may be deleted.

A clock that is set wrong, or set right after a start without one, makes everything look old at once.
"""

import logging
import math
import time
from collections.abc import Callable

import sqlalchemy as sa
from sqlalchemy.engine import Engine

from optiplan.service.store.tables import Clock, about, note

DAY = 86400.0
"""s that a clock goes evenly before anything is deleted by its time."""
STEP = 3600.0
"""s by which a clock may be set in between."""
KEY = "even clock"
_PASSED: int = getattr(time, "CLOCK_BOOTTIME", time.CLOCK_MONOTONIC)
"""Outside of Linux the clock that is never set may stand still while the machine sleeps: nothing is deleted then."""

_log = logging.getLogger("optiplan.service")


class EvenClock:
    """Watches the clocks of the database and of this machine; what it saw stands in the table `about`.

    Args:
        engine: of the database.
        machine: this machine's clock, s since 1970.
        passed: seconds that have passed since some instant, whatever the clocks are set to; the time in which the
            machine slept counts.
    """

    def __init__(
        self,
        engine: Engine,
        machine: Callable[[], float] = time.time,
        passed: Callable[[], float] = lambda: time.clock_gettime(_PASSED),
    ) -> None:
        self._engine, self._machine, self._passed = engine, machine, passed
        self._since = -math.inf
        self._last: tuple[float, float, float] | None = None

    def even(self) -> bool:
        """Look at the clocks; return whether they have gone evenly for a `DAY`, which a new database takes as given.

        A process that begins takes over what the last one saw, unless that was more than a `DAY` ago.
        """
        with self._engine.connect() as connection:
            stated = connection.scalar(sa.select(about.c.value).where(about.c.key == KEY))
            now = float(connection.scalar(sa.select(Clock())) or 0.0), self._machine(), self._passed()
        self._note(now, stated)
        note(self._engine, KEY, f"{self._since!r} {now[0]!r}")
        return now[0] - self._since >= DAY

    def _note(self, now: tuple[float, float, float], stated: str | None) -> None:
        """Note since when the clocks have gone evenly."""
        if self._last is not None:
            passed = now[2] - self._last[2]
            steps = [now[k] - self._last[k] - passed for k in (0, 1)]
        elif stated is None:
            steps = []
        else:
            since, last = map(float, stated.split())
            self._since = since
            steps = [] if -STEP <= now[0] - last <= DAY else [now[0] - last]
        self._last = now
        if any(abs(step) > STEP for step in steps):
            _log.warning("the clock has gone on by %.0f s at once: nothing is deleted for its age for a day", steps[0])
            self._since = now[0]
