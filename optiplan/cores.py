"""The processor cores that this process is given, and how its threads and processes share them."""

import multiprocessing
import os
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from multiprocessing.context import SpawnContext, SpawnProcess
from pathlib import Path

_GROUP = Path("/sys/fs/cgroup")
"""Where Linux, and within a container its runtime, shows the limits of this process's group."""

QUICK = 5e-4
"""s after which a thread of Python gives way, where one keeps time; of Python itself 5 ms, five ticks of 1 kHz."""

THREADS = "OMP_NUM_THREADS"
"""Variable by which numerical libraries, when they are loaded, set their number of threads."""

WHY_DEAD = 'killed, out of memory, or started by a script without `if __name__ == "__main__":` around its start'
"""Why a process may have ended before its work was done."""

_starting = threading.Lock()
_switching = threading.Lock()
_before: list[float] = []


def cores(group: Path = _GROUP) -> int:
    """Return how many cores this process may use: those it may run on, or the share of time its container has of them.

    Args:
        group: folder of the control group, of version 2 or 1.
    """
    allowed = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    share = _share(group)
    return allowed if share is None else max(1, min(allowed, int(share)))


def _share(group: Path) -> float | None:
    """Cores' worth of time that the group has; None without a limit."""
    try:
        if (group / "cpu.max").exists():
            quota, period = (group / "cpu.max").read_text().split()
        else:
            quota, period = ((group / f"cpu/cpu.cfs_{name}_us").read_text() for name in ("quota", "period"))
        share = float(quota) / float(period)
    except (OSError, ValueError, ZeroDivisionError):  # `max`: no limit
        return None
    return share if share > 0.0 else None


class OneThreadProcess(SpawnProcess):
    """A process whose numerical libraries have one thread each.

    It inherits the variable, since it may load them before any code of ours runs there.
    """

    def start(self) -> None:
        """Start the process; the variable is as before then.

        A process that is starting itself, since a script without a guard calls for processes while they import it,
        ends instead: it would start others without end, and the one that started it says so.
        """
        if getattr(multiprocessing.current_process(), "_inheriting", False):
            raise SystemExit(1)
        with _starting:
            before = os.environ.get(THREADS)
            os.environ[THREADS] = "1"
            try:
                super().start()
            finally:
                os.environ.pop(THREADS, None)
                os.environ.update({} if before is None else {THREADS: before})


class OneThreadContext(SpawnContext):
    """Context of such processes; they are spawned, since a fork would copy locks of threads."""

    Process = OneThreadProcess


def take_turns() -> None:
    """Let this thread run as all others do, in place of what `keeping_time` gave it."""
    with suppress(OSError, AttributeError):
        os.sched_setscheduler(threading.get_native_id(), os.SCHED_OTHER, os.sched_param(0))


@contextmanager
def keeping_time() -> Iterator[None]:
    """Let this thread run as soon as it wakes, meanwhile, before other programs: by `SCHED_FIFO`, where the user may.

    It must sleep most of the time. Other threads of Python give way to it after 0.5 ms.
    """
    with suppress(OSError, AttributeError):  # who may not keeps time as well as the machine is free
        os.sched_setscheduler(threading.get_native_id(), os.SCHED_FIFO, os.sched_param(1))
    with _switching:
        _before.append(sys.getswitchinterval())
        sys.setswitchinterval(min(QUICK, _before[0]))
    try:
        yield
    finally:
        take_turns()
        with _switching:
            first = _before[0]
            _before.pop()
            if not _before:
                sys.setswitchinterval(first)
