"""Process of a slot: reads problems, plans, makes pages; one request at a time, from a pipe.

Its arguments are those of `bench.execution.worker`. A request is a JSON object with `do`, a name of `tasks`; the answer
is a message with `phase: done`, its files behind it in one piece.
"""

import ctypes
import gc
import json
import os
import sys
import time
import traceback
from collections.abc import Callable, Mapping
from contextlib import suppress
from multiprocessing.connection import Connection
from typing import TYPE_CHECKING, Any

from optiplan.bench.execution.keeper import keep_a_child

if TYPE_CHECKING:
    from optiplan.trajectory.trajectory import Trajectory

EVERY = 0.1
"""s between two words about the same stage."""
DELIVERY = 0.005
"""s in which an answer reaches its caller, also on a machine of one core."""

Message = dict[str, Any]


def main(respite: float = 0.0) -> None:
    """Serve until the other end is closed, in a child of the keeper that this process becomes.

    Args:
        respite: s that the child has to end by itself, once its parent has ended or ends it.
    """
    socket, parent, _ = (int(word) for word in sys.argv[2:5])
    keep_a_child(parent, socket, respite=respite)
    connection = Connection(socket)
    from optiplan.bench.execution.worker import limit_memory, surroundings

    def send(message: Message, files: Mapping[str, bytes]) -> None:
        sizes = {name: len(content) for name, content in files.items()}
        whole = {**message, "sizes": sizes, "blob": bool(files)}
        connection.send_bytes(json.dumps(whole, allow_nan=False).encode())
        if files:
            connection.send_bytes(b"".join(files.values()))

    send({"phase": "ready", "pid": os.getpid()}, {})
    libc = ctypes.CDLL(None)
    tasks: Any = None
    while True:
        try:
            request = json.loads(connection.recv_bytes())
        except EOFError:
            return
        if "said" in request:  # to a task that had ended meanwhile
            continue
        if request["do"] == "set up":
            os.nice(request["nice"])
            limit_memory(request["memory"])
            tasks = _tasks(request)
            send({"phase": "done"}, {})
            continue
        before = surroundings()
        answer, files = _answer(tasks, request, Progress(send, connection))
        for stream in (sys.stdout, sys.stderr):
            with suppress(Exception):
                stream.flush()
        libc.fflush(None)
        try:
            send({**answer, "phase": "done", "spoilt": surroundings() != before}, files)
        except OSError:  # nobody is there any more
            return


def _tasks(settings: Mapping[str, Any]) -> Any:
    """The tasks, with everything loaded that most of them need."""
    from optiplan.service.execution.tasks import Tasks

    tasks = Tasks(settings)
    with suppress(Exception):  # a task will tell
        tasks.warm_up(settings["warm_up"])
    gc.collect()
    gc.freeze()  # what is loaded stays: looking through it for garbage again and again takes 50 ms each time
    return tasks


def _answer(tasks: Any, request: Mapping[str, Any], progress: "Progress") -> tuple[Message, dict[str, bytes]]:
    """What came of a request: an answer, or the error, as data."""
    from optiplan.errors import InputError, OptiPlanError

    try:
        do: Callable[..., tuple[Message, dict[str, bytes]]] = getattr(tasks, request["do"])
        answer, files = do(request, progress)
        json.dumps(answer, allow_nan=False)
        return answer, files
    except InputError as error:
        issues = [_without_paths(vars(issue), tasks.hide_paths) for issue in error.issues]
        return {"error": tasks.hide_paths(str(error)), "issues": issues}, {}
    except OptiPlanError as error:
        return {"error": tasks.hide_paths(str(error)), "issues": []}, {}
    except MemoryError:
        return {"error": "it takes more memory than this server allows", "issues": [], "memory": True}, {}
    except BaseException as error:
        text = "".join(traceback.format_exception(error, limit=-8))
        shown = tasks.hide_paths(f"internal error: {type(error).__name__}: {error}")
        return {"error": shown, "issues": [], "bug": text}, {}


def _without_paths(issue: Mapping[str, Any], hide: Callable[[str], str]) -> Message:
    return {key: hide(value) if isinstance(value, str) else value for key, value in issue.items()}


class Progress:
    """Tells of stages, of motions that were found and proved on the way, of states, and of the answer; and listens."""

    def __init__(self, send: Callable[[Message, Mapping[str, bytes]], None], connection: Connection) -> None:
        self._send, self._connection = send, connection
        self._stage, self._told = "", 0.0

    def __call__(self, stage: str, fraction: float) -> None:
        """Tell of a stage, now and then."""
        now = time.perf_counter()
        if stage == self._stage and now - self._told < EVERY:
            return
        self._stage, self._told = stage, now
        self._send({"phase": "stage", "stage": stage, "fraction": float(fraction)}, {})

    def proved(self, motion: "Trajectory", seconds: float) -> None:
        """Tell of a verified motion, proved so many seconds after the beginning."""
        self._send({"phase": "best", "seconds": seconds, "duration": motion.duration}, {})

    def state(self, state: Message) -> None:
        """Tell the state of something that runs."""
        self._send({**state, "phase": "state"}, {})

    def heard(self, patience: float) -> list[Message]:
        """What was said meanwhile to a task that listens, after waiting at most that long, s, for the first word."""
        found: list[Message] = []
        while self._connection.poll(0.0 if found else patience):
            try:
                found.append(json.loads(self._connection.recv_bytes())["said"])
            except EOFError:  # nobody is there any more
                return [{"stop": True}]
        return found

    def answered(self, answer: Message, files: Mapping[str, bytes]) -> None:
        """Tell what somebody waits for, before the rest is made; the processor is theirs until they have it."""
        self._send({**answer, "phase": "answered"}, files)
        time.sleep(DELIVERY)
