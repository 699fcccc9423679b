"""Keeper of a worker: ends and reaps all processes that the worker started, independent of process 1.

The keeper is a child subreaper: processes whose parent ends become its children, also those with a session of their
own, so none of them is lost and none stays behind as a zombie.

Source: prctl(2), PR_SET_CHILD_SUBREAPER and PR_SET_PDEATHSIG.
"""

import ctypes
import os
import resource
import signal
from contextlib import suppress
from types import FrameType

from optiplan.bench.execution import machine

PR_SET_PDEATHSIG = 1
"""The signal to be sent to us when our parent ends."""
PR_SET_CHILD_SUBREAPER = 36
"""Orphans among our descendants become our children."""
RESPITE = 3.0
"""s that a worker which moves a robot has to stop it, once nobody watches over it."""


def keep_a_child(parent: int, *closed: int, respite: float = 0.0) -> None:
    """Fork: return in the child, the worker; the calling process becomes its keeper and never returns.

    The keeper ends as the worker does, by the same exit code or signal, once all that the worker started has ended.
    On SIGTERM, which it also gets when `parent` ends, it ends the worker first. A worker ends with its keeper.

    Args:
        parent: the process that must live for the keeper to live.
        closed: file descriptors that are the worker's alone.
        respite: s that the worker has to end by itself first.
    """
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGTERM})
    ctypes.CDLL(None).prctl(PR_SET_CHILD_SUBREAPER, 1)
    _signal_at_end_of(parent, signal.SIGTERM)
    keeper, child = os.getpid(), os.fork()
    if child == 0:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGTERM})
        _signal_at_end_of(keeper, signal.SIGKILL)
        return
    for handle in (*closed, 0, 1, 2):
        os.close(handle)

    def end(number: int, frame: FrameType | None) -> None:
        if respite and number == signal.SIGTERM:
            signal.setitimer(signal.ITIMER_REAL, respite)
            return
        with suppress(ProcessLookupError):
            os.kill(child, signal.SIGKILL)

    signal.signal(signal.SIGTERM, end)
    signal.signal(signal.SIGALRM, end)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGTERM})
    _end_as(_reaped(child))


def _reaped(child: int) -> int:
    """The wait status of the child, after whose end all others below us are ended and reaped."""
    found = None
    while True:
        try:
            pid, status = os.wait()
        except ChildProcessError:
            return 0 if found is None else found
        found = status if pid == child else found
        if found is not None:  # orphans come to us one after the other, as their parents end
            for each in machine.descendants(os.getpid()):
                with suppress(ProcessLookupError):
                    os.kill(each, signal.SIGKILL)


def _end_as(status: int) -> None:
    """End by the exit code or the signal of a wait status."""
    if os.WIFSIGNALED(status):
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))  # the worker's core is enough
        number = os.WTERMSIG(status)
        if number not in (signal.SIGKILL, signal.SIGSTOP):
            signal.signal(number, signal.SIG_DFL)
        os.kill(os.getpid(), number)
    os._exit(os.waitstatus_to_exitcode(status))


def _signal_at_end_of(parent: int, number: int) -> None:
    """Be sent the signal when the parent ends, however that happens; end at once if it has ended already."""
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, number)
    if os.getppid() != parent:
        os._exit(1)
