"""Libraries that are slow to import, and a clock that stands still while they are loaded.

They are imported by the function that needs them, since most runs need none; a budget is for work, not for the disk.
"""

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

_lock = threading.Lock()


class _Meter:
    """Seconds of loading so far, how many threads are loading by now, and since when the first of them is."""

    spent, loading, since = 0.0, 0, 0.0


@contextmanager
def loading() -> Iterator[None]:
    """Stop the `clock` of all threads; for import statements, of which all but the first take no time."""
    with _lock:
        if _Meter.loading == 0:
            _Meter.since = time.perf_counter()
        _Meter.loading += 1
    try:
        yield
    finally:
        with _lock:
            _Meter.loading -= 1
            if _Meter.loading == 0:
                _Meter.spent += time.perf_counter() - _Meter.since


def clock() -> float:
    """Seconds since some time, as `time.perf_counter`, but for those spent on `loading`."""
    with _lock:
        return (_Meter.since if _Meter.loading else time.perf_counter()) - _Meter.spent


def time_loading() -> float:
    """Seconds that were spent on `loading` in this process."""
    with _lock:
        return _Meter.spent + (time.perf_counter() - _Meter.since if _Meter.loading else 0.0)
