"""Functions that are called with what an execution does, from a thread of their own."""

import logging
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from optiplan.errors import described, wrong_argument
from optiplan.execution.loop.driver_checks import in_words
from optiplan.execution.loop.tick_loop import TickLoop

REPORTS = 60.0
"""Hz: states that subscribers get at most."""

Message = dict[str, Any]

log = logging.getLogger(__name__)


class Subscribers:
    """Those of one execution: they see its loop, and hear of its end once `over` is set."""

    def __init__(self, loop: TickLoop, snapshot: Callable[[], Message], over: threading.Event) -> None:
        self._loop, self._snapshot, self._over = loop, snapshot, over
        self._callbacks: list[Callable[[Message], None]] = []

    def add(self, callback: Callable[[Message], None]) -> Callable[[], None]:
        """Call a function from now on; return what ends that.

        Raises:
            InputError: it is no function.
        """
        if not callable(callback):
            raise wrong_argument("Execution.subscribe", "callback", described(callback), "a function of a message")
        self._callbacks.append(callback)
        return lambda: self._drop(callback)

    def report(self) -> None:
        """Report states and events until the end: what the thread does."""
        done, last = 0, -1.0
        while not self._over.wait(1.0 / REPORTS):
            done = self._report_events(done)
            tick = self._loop.tick
            if tick is not None and tick.t != last:
                last = tick.t
                self._publish({"kind": "state", **self._snapshot()})
        self._report_events(done)
        self._publish({"kind": "end", **self._snapshot()})

    def _report_events(self, done: int) -> int:
        events = list(self._loop.events)
        for event in events[done:]:
            self._publish({"kind": "event", "event": event.to_data()})
        return len(events)

    def _publish(self, message: Message) -> None:
        for callback in list(self._callbacks):
            try:
                callback(message)
            except BaseException as error:  # a reader is no reason to stop a robot, nor to leave the others without
                log.warning("a subscriber of an execution raised, and gets nothing more: %s", in_words(error))
                self._drop(callback)

    def _drop(self, callback: Callable[[Message], None]) -> None:
        with suppress(ValueError):  # it is gone already
            self._callbacks.remove(callback)
