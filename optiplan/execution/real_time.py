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
    """Run this thread, and the threads that it starts, before others; collect no garbage meanwhile.

    Yields:
        Whether this user may run before others; where not, a busy machine may be late.
    """
    before = sys.getswitchinterval()
    sys.setswitchinterval(SWITCH)
    gc.collect()
    gc.disable()  # looking through all that is loaded takes 50 ms
    try:
        yield _run(before_others=True)
    finally:
        in_turn()
        gc.enable()
        sys.setswitchinterval(before)


def in_turn() -> None:
    """Run this thread as others do: one that computes for long would take the machine from them."""
    _run(before_others=False)


def _run(before_others: bool) -> bool:
    """Return whether this thread now runs so."""
    policy, priority = (os.SCHED_RR, 1) if before_others else (os.SCHED_OTHER, 0)
    try:
        os.sched_setscheduler(0, policy, os.sched_param(priority))
    except (AttributeError, OSError):  # not on this system, or not for this user
        return False
    return True
