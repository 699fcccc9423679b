"""Run tasks of a suite on a machine of a cluster: take one, request missing files, run it in a slot.

Knows nothing of Dask but that its functions are called there: `carry_out` in the worker's threads, the others between.
"""

import os
import platform
import threading
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from importlib import metadata

from optiplan.bench.dask.file_transfer import BundleContents, keep, lacking, unpack
from optiplan.bench.execution.code_version import own_digest
from optiplan.bench.execution.slot import WorkerSlot
from optiplan.bench.results.records import BenchTask, Outcome
from optiplan.runs.run import versions

Bill = Mapping[str, BundleContents]
"""Bundles by their digest."""


@dataclass(frozen=True)
class Wanted:
    """The answer of a machine that lacks bundles: send the task again, with these."""

    digests: frozenset[str]


@dataclass(frozen=True)
class Other:
    """The answer of a machine that would not give the same results: what differs, in words."""

    words: tuple[str, ...]


@dataclass
class _Seat:
    """A thread of a worker and its slot; the lock is held while a task runs."""

    slot: WorkerSlot
    lock: threading.Lock = field(default_factory=threading.Lock)


@dataclass
class _Shift:
    """State of one session of `optiplan bench` on this machine."""

    stop: threading.Event = field(default_factory=threading.Event)
    seats: dict[int, _Seat] = field(default_factory=dict)


_shifts: dict[str, _Shift] = {}
_lock = threading.Lock()


@cache
def signature() -> dict[str, str]:
    """Return what must agree on every machine for results to be equal: versions, and the digest of optiplan's code."""
    found = versions() | {"optiplan's code": own_digest()[:12], "processor": platform.machine()}
    found["python"] = found["python"].rpartition(".")[0]
    try:
        return found | {"example-robot-data": metadata.version("example-robot-data")}
    except metadata.PackageNotFoundError:
        return found | {"example-robot-data": "not installed"}


def differences(theirs: Mapping[str, str]) -> tuple[str, ...]:
    """Return the differences of this machine from the `signature` of another, in words."""
    ours = signature()
    names = dict.fromkeys((*theirs, *ours))
    return tuple(
        f"{name} {ours.get(name)} there, {theirs.get(name)} here"
        for name in names
        if ours.get(name) != theirs.get(name)
    )


def carry_out(session: str, expected: Mapping[str, str], task: BenchTask, bill: Bill) -> Outcome | Wanted | Other:
    """Run a packed task in this thread's slot.

    Args:
        session: of `optiplan bench`; its slots end with it.
        expected: the `signature` of who asks.
        task: with its problem packed.
        bill: bundles that were found lacking before.

    Raises:
        Stopped: the session has ended.
        WorkerError: no process can be started here.
    """
    words = differences(expected)
    if words:
        return Other(words)
    for digest, bundle_contents in bill.items():
        keep(digest, bundle_contents)
    missing = lacking(task.problem)
    if missing:
        return Wanted(frozenset(missing))
    seat = _seat(session)
    with seat.lock:
        return seat.slot.run(replace(task, problem=unpack(task.problem)))


def leave(session: str) -> None:
    """End a session here: runs under way are given up, its processes ended."""
    with _lock:
        shift = _shifts.setdefault(session, _Shift())
        shift.stop.set()
        seats = list(shift.seats.values())
    for seat in seats:
        with seat.lock:
            seat.slot.close()


def _seat(session: str) -> _Seat:
    """This thread's; processes of sessions that ended without a word are ended now."""
    thread = threading.get_ident()
    with _lock:
        for other, shift in _shifts.items():
            if other != session and thread in shift.seats:
                shift.seats.pop(thread).slot.close()
        shift = _shifts.setdefault(session, _Shift())
        if thread not in shift.seats:
            name = f"{platform.node()}/{os.getpid()}/{len(shift.seats)}"
            shift.seats[thread] = _Seat(WorkerSlot(name, shift.stop))
        return shift.seats[thread]
