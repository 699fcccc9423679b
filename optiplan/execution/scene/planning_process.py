"""Other motions to the goal of a run, planned in a process of their own while the run is executed."""

import logging
import time
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from threading import Event, Lock, Thread
from typing import TYPE_CHECKING

from optiplan.cores import WHY_DEAD, OneThreadContext
from optiplan.errors import OptiPlanError, named_reason, wrong_argument
from optiplan.execution.paths.next_path import NextPath
from optiplan.execution.paths.path_laws import rests
from optiplan.execution.paths.proved_path import ProvedPath
from optiplan.execution.scene.planning_worker import (
    MARGIN,
    PLANNER,
    ROOM,
    FirstMotion,
    ReplanReply,
    ReplanRequest,
    serve,
)
from optiplan.execution.scene.policy import Policy
from optiplan.execution.scene.scene_watch import SceneWatch
from optiplan.execution.scene.seen_scene import SeenScene
from optiplan.geometry.safety import SafePairs
from optiplan.records import dataclass
from optiplan.runs.run import Run
from optiplan.trajectory.state import State

if TYPE_CHECKING:
    from optiplan._core._core_base import TimeLaw

_log = logging.getLogger(__name__)

WARM_UP = 60.0
"""s, within which the process must have planned for the first time."""

IN_TIME, BUDGET_AT_REST = 0.6, 0.5
"""Budget of planning: share of the latency while the robot moves; s, where it stands still and may wait."""


@dataclass(frozen=True, eq=False)
class PlannedPath:
    """Another path to the goal, ready to take over.

    Attributes:
        then: when it begins, s.
        law: from whose state at that time.
        since: when it was asked for, s.
        number: of its request.
        path: None where there is none.
        watch: of that path.
        seconds: of processor time, of planning, proving and preparing it.
    """

    then: float
    law: "TimeLaw"
    since: float
    number: int
    path: ProvedPath | None = None
    watch: SceneWatch | None = None
    seconds: float = 0.0


class PlanningProcess:
    """Plan from states of a robot on its way, one at a time.

    A process plans among the obstacles as they will move, and proves the motion among those that stand still. A thread
    makes the laws of the new path. Whether that is clear of what moves is checked by the executor, where it takes over.
    `PlanningProcess.of` takes one that is left over from an earlier run.

    Attributes:
        lost: whether the process ended.
        number: of the motion that the robot follows.
    """

    def __init__(self) -> None:
        self._done: deque[PlannedPath] = deque()
        self._asked: tuple[PlannedPath, ReplanRequest] | None = None
        self._ready, self._sending, self.lost = Event(), Lock(), False
        self.number = self._last = self._heard = 0  # the last first motion that the process has heard of
        context = OneThreadContext()
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(target=serve, args=(theirs,), daemon=True)
        self._process.start()
        theirs.close()
        Thread(target=self._listen, daemon=True).start()

    @classmethod
    def of(
        cls, run: Run, watch: SceneWatch, policy: Policy, prepare: Callable[[ProvedPath], None]
    ) -> "PlanningProcess":
        """Return a process that knows a run and has planned on its way.

        Args:
            run: that is executed, of a problem without a task or vias.
            watch: of its path.
            policy: with the latency.
            prepare: makes what else is needed of a path that is to take over.

        Raises:
            InputError: the run has a task or vias.
            OptiPlanError: the process ended, or does not answer.
        """
        found = policy.refused(run.problem)
        if found:
            raise wrong_argument("Executor", "policy", f"replan, with a run of {found}", "wait, stop or slow")
        with _lock:
            found_idle = [one for one in _idle if not one.lost]
            _idle[:] = found_idle[1:]
        one = found_idle[0] if found_idle else cls()
        one._begin(run, watch, policy, prepare)
        return one

    def _begin(self, run: Run, watch: SceneWatch, policy: Policy, prepare: Callable[[ProvedPath], None]) -> None:
        self._policy, self._prepare = policy, prepare
        self.follow(run, watch, warm=False)
        if not self._ready.wait(WARM_UP) or self.lost:
            why = f"ended at once: {WHY_DEAD}" if self.lost else f"does not answer within {WARM_UP:g} s"
            self.close()
            raise OptiPlanError(f"the planning process of Executor {why}")

    def follow(self, run: Run, watch: SceneWatch, number: int = 0, *, warm: bool = True) -> None:
        """Plan from now on for a robot that follows a run, to its goal.

        Args:
            run: one that the process planned, of that `number`, or with 0 another one.
            watch: of its path.
            number: of the request that it answered.
            warm: whether the process has planned before.
        """
        if number:
            self.number = number
            return
        assert run.trajectory is not None
        self._problem, self._watch, self._duration, self._asked = run.problem, watch, run.trajectory.duration, None
        self._done.clear()
        self._ready.clear()
        self._last += 1
        self.number = self._first = self._last
        first = FirstMotion(self._last, run.problem, run.trajectory, warm)  # it may be large
        Thread(target=self._send, args=(first,), daemon=True).start()

    def _send(self, first: FirstMotion) -> None:
        with self._sending:
            if first.number != self._first:  # the robot follows another one already
                return
            self._post(first)

    def _post(self, message: FirstMotion | ReplanRequest) -> None:
        try:
            self._pipe.send(message)
        except Exception as error:  # whatever it is, the robot must not wait for an answer
            _log.warning("nothing can be sent to the planning process: %s", named_reason(error))
            self.lost = True
            self._ready.set()

    def seek(self, law: "TimeLaw", now: float, state_at: Callable[[float], State], scene: SeenScene) -> None:
        """Ask for a path from the state in which a law will be after the latency, unless an answer is still to come."""
        if self._asked is not None or self._heard != self._first:
            return
        latency = self._policy.latency
        then = now + latency
        self._last += 1
        margin = MARGIN + self._watch.margin + scene.spread * self._duration
        seconds = BUDGET_AT_REST if rests(law, then) else IN_TIME * latency
        apart = None
        if self._watch.margin > self._watch.asked:
            apart = SafePairs(("*",), scene.names, self._watch.margin + ROOM)
        request = ReplanRequest(self._last, self.number, state_at(then), scene.at(then), margin, seconds, apart)
        self._asked = PlannedPath(then, law, now, self._last), request
        self._post(request)

    def answer(self, law: "TimeLaw", now: float) -> NextPath | None:
        """Return the path that was asked for, once it is there, if the robot can still take it from the law."""
        if not self._done:
            return None
        found = self._done.popleft()
        if self._asked is not None and self._asked[0].number == found.number:
            self._asked = None
        if found.path is None or found.law is not law:
            return None
        late = rests(law, now) and found.path.starts_at_rest
        then = max(found.then, now) if late else found.then
        return None if then < now else NextPath(then, found.path, found.watch, found.number)

    def close(self) -> None:
        """End the process."""
        self.lost = True
        self._process.kill()
        self._process.join()

    def leave(self) -> None:
        """Leave the process to another run."""
        with _lock:
            if not self.lost and not _idle:
                _idle.append(self)
                return
        self.close()

    def _listen(self) -> None:
        """Receive motions and prepare their paths, until the process ends."""
        try:
            while True:
                reply: ReplanReply = self._pipe.recv()
                asked = self._asked
                if asked is not None and asked[0].number == reply.number:
                    self._done.append(self._prepared(*asked, reply))
                elif reply.number == self._first:
                    self._heard = reply.number  # even if the robot follows another one since: then nothing is asked
                    self._ready.set()
        except (EOFError, OSError):  # the process has ended
            pass
        finally:
            self.lost = True
            self._ready.set()

    def _prepared(self, asked: PlannedPath, request: ReplanRequest, reply: ReplanReply) -> PlannedPath:
        began = time.thread_time() - reply.seconds
        if reply.motion is None or reply.report is None or not reply.report.verified:
            _log.info("there is no other motion: %s", reply.words)
            return replace(asked, seconds=reply.seconds)
        problem = request.standing(self._problem)
        run = Run(problem, PLANNER, {}, reply.motion, None, reply.report, None, None, {}, {})
        try:
            path = ProvedPath(run, "Executor")
        except OptiPlanError as error:
            _log.info("the other motion cannot be executed: %s", error)
            return asked
        watch = self._watch.over(path)
        watch.prepare(path.forwards)
        self._prepare(path)
        return replace(asked, path=path, watch=watch, seconds=time.thread_time() - began)


_idle: list[PlanningProcess] = []
"""A process that is left over from an earlier run: the next one need not wait for its start."""

_lock = Lock()
