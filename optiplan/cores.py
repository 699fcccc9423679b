"""The processor cores that this process is given."""

import os
from pathlib import Path

_GROUP = Path("/sys/fs/cgroup")
"""Where Linux, and within a container its runtime, shows the limits of this process's group."""


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
