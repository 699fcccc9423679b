"""What a planning process does: plan from a state on the way, warm, and prove what it found."""

import contextlib
import os
import time
from multiprocessing.connection import Connection
from typing import NamedTuple

from optiplan.geometry.scene import Scene
from optiplan.planners.base import Budget
from optiplan.planners.common.via_legs import plan_through
from optiplan.planners.registry import make_planner
from optiplan.problem.problem import Problem, derived
from optiplan.trajectory.state import State
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.report import Report
from optiplan.verify.verify import verify

PLANNER = "trajopt"
"""It begins at an earlier motion, from a robot that moves, and times its motions between moving obstacles."""


class ReplanRequest(NamedTuple):
    """What is to be planned: from which state, in which scene, to the problem's goal.

    `number` is that of the motion, `earlier` that of the one that the robot follows, `margin`, m,
    the clearance to aim at, and `seconds` the budget.
    """

    number: int
    earlier: int
    start: State
    scene: Scene
    margin: float
    seconds: float

    def problem(self, first: Problem) -> Problem:
        """Return the problem of the request: as the first one, but for start and scene."""
        start = {"start": self.start.q, "start_velocity": self.start.v, "start_acceleration": self.start.a}
        return derived(first, **start, scene=self.scene)

    def standing(self, first: Problem) -> Problem:
        """Return the same among the obstacles that stand still."""
        return derived(self.problem(first), scene=self.scene.standing)


class ReplanReply(NamedTuple):
    """The motion to a request, with the report on it among the obstacles that stand still; or why there is none.

    `number`: of the request. `seconds`: of processor time.
    """

    number: int
    motion: Trajectory | None = None
    report: Report | None = None
    words: str = ""
    seconds: float = 0.0


class FirstMotion(NamedTuple):
    """The motion that a robot begins to follow, of which problem."""

    number: int
    problem: Problem
    motion: Trajectory


def serve(pipe: Connection) -> None:
    """Plan what is asked for, until the other end is closed."""
    os.environ["OMP_NUM_THREADS"] = "1"
    first, motions = None, dict[int, Trajectory]()
    with contextlib.suppress(EOFError, OSError, KeyboardInterrupt):
        while True:
            asked: FirstMotion | ReplanRequest = pipe.recv()
            began = time.process_time()
            if isinstance(asked, FirstMotion):
                first, motions = asked.problem, {asked.number: asked.motion}
                reply = _warmed_up(asked)
            else:
                assert first is not None
                motions = {number: one for number, one in motions.items() if number >= asked.earlier}
                reply = answer(asked, first, motions)
                if reply.motion is not None:
                    motions[asked.number] = reply.motion
            pipe.send(reply._replace(number=asked.number, seconds=time.process_time() - began))


def answer(request: ReplanRequest, first: Problem, motions: dict[int, Trajectory]) -> ReplanReply:
    """Plan, and prove; whatever is raised becomes the reply."""
    try:
        planner = make_planner(PLANNER, {"margin": request.margin})
        problem, budget = request.problem(first), Budget(request.seconds)
        found = plan_through(planner, problem, budget, lambda stage, share: None, motions.get(request.earlier))
        if found.trajectory is None:
            return ReplanReply(request.number, words="" if found.failure is None else found.failure.detail)
        report = verify(request.standing(first), found.trajectory)
        words = "" if report.verified else "the motion that was found is refused"
        return ReplanReply(request.number, found.trajectory, report, words)
    except Exception as error:
        return ReplanReply(request.number, words=f"{type(error).__name__}: {error}")


def _warmed_up(first: FirstMotion) -> ReplanReply:
    """Plan on the way, so that what is loaded and kept is there; the reply is empty."""
    problem, motion = first.problem, first.motion
    for share in (0.1, 0.2):
        start = motion.state(share * motion.duration)
        answer(ReplanRequest(0, 0, start, problem.scene, 0.01, 2.0), problem, {0: motion})
    return ReplanReply(first.number)
