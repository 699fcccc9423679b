"""Description and load of the machine that runs are made on."""

import os
import platform
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from optiplan.cores import cores


def machine() -> dict[str, Any]:
    """Name, processor, number of cores that may be used, memory (MB), system: JSON-ready."""
    return {
        "host": platform.node(),
        "cpu": _field("/proc/cpuinfo", "model name") or platform.processor() or platform.machine(),
        "cores": cores(),
        "memory": int((_field("/proc/meminfo", "MemTotal") or "0").split()[0]) // 1000,
        "system": platform.platform(),
        "load": load_average(),
    }


def load_average() -> float:
    """Return the load average of the last minute."""
    return os.getloadavg()[0]


def now() -> str:
    """The time in UTC, ISO 8601 to the millisecond."""
    return datetime.now(UTC).isoformat(timespec="milliseconds")


def resident(pids: Sequence[int]) -> float:
    """Resident memory of processes, MB, what they share counted once; 0 for those that are gone."""
    if len(pids) > 1:
        return sum(_share(each) for each in pids)
    try:
        pages = int(Path(f"/proc/{pids[0]}/statm").read_text().split()[1])
    except (OSError, IndexError, ValueError):
        return 0.0
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def descendants(pid: int) -> list[int]:
    """The processes that a process started, that those started, and so on; without those whose parent has ended."""
    try:
        texts = [(task / "children").read_text() for task in Path(f"/proc/{pid}/task").iterdir()]
    except OSError:
        return []
    children = [int(child) for text in texts for child in text.split()]
    return children + [each for child in children for each in descendants(child)]


def ended(pid: int) -> bool:
    """Return whether a process has ended; a zombie has."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] in "ZX"
    except OSError:
        return True


def physical_cores() -> list[int]:
    """The cores that this process may use, one of every physical core before the second threads of any."""
    seen: list[str] = []
    ranked = []
    for core in sorted(os.sched_getaffinity(0)):
        try:
            physical = Path(f"/sys/devices/system/cpu/cpu{core}/topology/thread_siblings_list").read_text()
        except OSError:
            physical = str(core)
        ranked.append((seen.count(physical), core))
        seen.append(physical)
    return [core for _, core in sorted(ranked)]


def _share(pid: int) -> float:
    """Resident memory, MB; of pages in common with other processes its part."""
    kilobytes = _field(f"/proc/{pid}/smaps_rollup", "Pss:")
    return int((kilobytes or "0").split()[0]) * 1.024e-3


def _field(file: str, name: str) -> str | None:
    try:
        lines = Path(file).read_text().splitlines()
    except OSError:
        return None
    return next((line.partition(":")[2].strip() for line in lines if line.startswith(name)), None)
