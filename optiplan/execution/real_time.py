"""What lets a process send its set-points in time, whatever else the machine does.

Source: sched(7): a thread under SCHED_RR runs before all under SCHED_OTHER; it takes CAP_SYS_NICE or RLIMIT_RTPRIO.
"""

import gc
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager

SWITCH = 5e-4
"""s after which a thread that computes lets that of the set-points run."""

RESPITE = 3.0
"""s that a process which moves a robot has to stop it, once nobody watches over it."""


@contextmanager
def in_time() -> Iterator[bool]:
    """Run this thread, and those and the processes that it starts, before others; collect no garbage meanwhile.

    Yields:
        Whether this user may run before others; where not, a busy machine may be late.
    """
    before = sys.getswitchinterval()
    sys.setswitchinterval(SWITCH)
    gc.collect()
    gc.disable()  # looking through all that is loaded takes 50 ms
    first = _round_robin(True)
    try:
        yield first
    finally:
        if first:
            _round_robin(False)
        gc.enable()
        sys.setswitchinterval(before)


def _round_robin(first: bool) -> bool:
    """Return whether this thread now runs before others, or as they do."""
    policy, priority = (os.SCHED_RR, 1) if first else (os.SCHED_OTHER, 0)
    try:
        os.sched_setscheduler(0, policy, os.sched_param(priority))
    except (AttributeError, OSError):  # not on this system, or not for this user
        return False
    return True
