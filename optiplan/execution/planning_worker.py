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


class PlanRequest(NamedTuple):
    """What is to be planned: from which state, in which scene, to the problem's goal.

    `number` is that of the motion, `earlier` that of the one that the robot follows (0: the first one), `margin`, m,
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


class PlanReply(NamedTuple):
    """The motion to a request, with the report on it among the obstacles that stand still; or why there is none.

    `seconds`: of processor time.
    """

    motion: Trajectory | None
    report: Report | None
    words: str = ""
    seconds: float = 0.0


def serve(pipe: Connection, problem: Problem, motion: Trajectory) -> None:
    """Plan what is asked for, until the other end is closed; say `None` when the first motion has been planned."""
    os.environ["OMP_NUM_THREADS"] = "1"
    motions = {0: motion}
    with contextlib.suppress(EOFError, OSError, KeyboardInterrupt):
        for k in (0.1, 0.2):  # what is loaded and kept is there afterwards
            start = motion.state(k * motion.duration)
            answer(PlanRequest(0, 0, start, problem.scene, 0.01, 2.0), problem, motions)
        pipe.send(None)
        while True:
            request: PlanRequest = pipe.recv()
            motions = {number: one for number, one in motions.items() if number >= request.earlier}
            began = time.process_time()
            reply = answer(request, problem, motions)
            reply = reply._replace(seconds=time.process_time() - began)
            if reply.motion is not None:
                motions[request.number] = reply.motion
            pipe.send(reply)


def answer(request: PlanRequest, first: Problem, motions: dict[int, Trajectory]) -> PlanReply:
    """Plan, and prove; whatever is raised becomes the reply."""
    try:
        planner = make_planner(PLANNER, {"margin": request.margin})
        problem, budget = request.problem(first), Budget(request.seconds)
        found = plan_through(planner, problem, budget, lambda stage, share: None, motions.get(request.earlier))
        if found.trajectory is None:
            return PlanReply(None, None, "" if found.failure is None else found.failure.detail)
        report = verify(request.standing(first), found.trajectory)
        return PlanReply(found.trajectory, report, "" if report.verified else "the motion that was found is refused")
    except Exception as error:
        return PlanReply(None, None, f"{type(error).__name__}: {error}")
