"""Run tasks of a suite on a worker of a cluster: request missing files, then run the task in a slot.

Independent of Dask: `carry_out` is called in the worker's threads, the other functions between tasks.
"""

import os
import platform
import threading
from collections.abc import Mapping
from dataclasses import field, replace
from functools import cache
from importlib import metadata

from optiplan.bench.dask.file_transfer import BundleContents, keep, lacking, unpack_files
from optiplan.bench.execution.code_version import own_digest
from optiplan.bench.execution.slot import WorkerSlot
from optiplan.bench.results.records import BenchTask, Outcome
from optiplan.records import dataclass
from optiplan.runs.run import versions

Bundles = Mapping[str, BundleContents]
"""Bundles by their digest."""


@dataclass(frozen=True)
class MissingBundles:
    """Answer of a worker that lacks bundles: the task is sent again with these."""

    digests: frozenset[str]


@dataclass(frozen=True)
class Incompatible:
    """Answer of a worker whose results may differ: the differences in words."""

    words: tuple[str, ...]


@dataclass
class _ThreadSlot:
    """A thread of a worker and its slot; the lock is held while a task runs."""

    slot: WorkerSlot
    lock: threading.Lock = field(default_factory=threading.Lock)


@dataclass
class _SessionState:
    """State of one session of `optiplan bench` on this machine."""

    stop: threading.Event = field(default_factory=threading.Event)
    slots: dict[int, _ThreadSlot] = field(default_factory=dict)


_sessions: dict[str, _SessionState] = {}
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


def version_differences(theirs: Mapping[str, str]) -> tuple[str, ...]:
    """Return the differences of this machine from the `signature` of another, in words."""
    ours = signature()
    names = dict.fromkeys((*theirs, *ours))
    return tuple(
        f"{name} {ours.get(name)} there, {theirs.get(name)} here"
        for name in names
        if ours.get(name) != theirs.get(name)
    )


def carry_out(
    session: str, expected: Mapping[str, str], task: BenchTask, bundles: Bundles
) -> Outcome | MissingBundles | Incompatible:
    """Run a packed task in this thread's slot.

    Args:
        session: of `optiplan bench`; its slots end with it.
        expected: the `signature` of the runner.
        task: with its problem packed.
        bundles: bundles requested before.

    Raises:
        Stopped: the session has ended.
        WorkerError: no process can be started here.
    """
    words = version_differences(expected)
    if words:
        return Incompatible(words)
    for digest, bundle_contents in bundles.items():
        keep(digest, bundle_contents)
    missing = lacking(task.problem)
    if missing:
        return MissingBundles(frozenset(missing))
    thread_slot = _thread_slot(session)
    with thread_slot.lock:
        return thread_slot.slot.run(replace(task, problem=unpack_files(task.problem)))


def end_session(session: str) -> None:
    """End a session here: cancel its runs and end its processes."""
    with _lock:
        state = _sessions.setdefault(session, _SessionState())
        state.stop.set()
        slots = list(state.slots.values())
    for thread_slot in slots:
        with thread_slot.lock:
            thread_slot.slot.close()


def _thread_slot(session: str) -> _ThreadSlot:
    """Return this thread's slot; end the processes of sessions lost without notice."""
    thread = threading.get_ident()
    with _lock:
        for other, state in _sessions.items():
            if other != session and thread in state.slots:
                state.slots.pop(thread).slot.close()
        state = _sessions.setdefault(session, _SessionState())
        if thread not in state.slots:
            name = f"{platform.node()}/{os.getpid()}/{len(state.slots)}"
            state.slots[thread] = _ThreadSlot(WorkerSlot(name, state.stop))
        return state.slots[thread]
