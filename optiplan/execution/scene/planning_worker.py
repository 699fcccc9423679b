"""What a planning process does: plan from a state on the way, warm, and prove what it found."""

import contextlib
import gc
import time
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from multiprocessing.connection import Connection
from threading import Event
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from optiplan.errors import named_reason
from optiplan.geometry.safety import SafePairs, Safety
from optiplan.geometry.scene import Obstacle, Scene
from optiplan.geometry.shapes import Sphere
from optiplan.planners.base import Budget, Planner
from optiplan.planners.common.via_legs import plan_through
from optiplan.planners.registry import make_planner
from optiplan.problem.problem import Problem, derived
from optiplan.trajectory.state import State
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.report import Report
from optiplan.verify.verify import verify

PLANNER = "trajopt"
"""It begins at an earlier motion, from a robot that moves, and times its motions between moving obstacles."""

COARSE = {"spans": 16, "samples": 40}
"""Options of the planner by which it finds a motion sooner than with its own."""

MARGIN = 0.02
"""m, that motions keep from obstacles where there is room, beyond what is demanded: bodies are watched in cells."""


class ReplanRequest(NamedTuple):
    """What is to be planned: from which state, in which scene, to the problem's goal.

    `number` is that of the motion, `earlier` that of the one that the robot follows, `margin`, m,
    the clearance to aim at, and `seconds` the budget. `apart`: what must keep a distance that the problem does not ask.
    """

    number: int
    earlier: int
    start: State
    scene: Scene
    margin: float
    seconds: float
    apart: SafePairs | None = None

    def problem(self, first: Problem) -> Problem:
        """Return the problem of the request: as the first one, but for start and scene."""
        start = {"start": self.start.q, "start_velocity": self.start.v, "start_acceleration": self.start.a}
        safety = self.scene.safety
        if self.apart is not None:
            safety = replace(safety or Safety(), pairs=(*(safety or Safety()).pairs, self.apart))
        return derived(first, **start, scene=replace(self.scene, safety=safety))

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
    """The motion that a robot begins to follow, of which problem; whether the process has planned before."""

    number: int
    problem: Problem
    motion: Trajectory
    warm: bool = False


ROOM = 0.01
"""m beyond the clearance of the executor: about what watching in cells, and the policy's spare, take of it."""


def serve(pipe: Connection) -> None:
    """Plan what is asked for, until the other end is closed."""
    first, motions = None, dict[int, Trajectory]()
    with contextlib.suppress(EOFError, OSError, KeyboardInterrupt):
        while True:
            gc.collect()  # not while somebody waits
            gc.disable()
            asked: FirstMotion | ReplanRequest = pipe.recv()
            if isinstance(asked, FirstMotion):
                first, motions = asked.problem, {asked.number: asked.motion}
                if not asked.warm:
                    _warm_up(asked)
                pipe.send(ReplanReply(asked.number))
                continue
            assert first is not None
            motions = {number: one for number, one in motions.items() if number >= asked.earlier}
            reply = answer(asked, first, motions)
            pipe.send(reply)
            if reply.motion is not None:
                motions[asked.number] = reply.motion


class FirstFound:
    """Progress that ends the planning with the first motion that is free: the robot is waiting for it."""

    def __init__(self) -> None:
        self.ended = Event()

    def __call__(self, stage: str, share: float) -> None:
        """Ignore the stage."""

    def found(self, motion: Trajectory, bound: float) -> None:
        """End the planning."""
        self.ended.set()


def answer(request: ReplanRequest, first: Problem, motions: Mapping[int, Trajectory]) -> ReplanReply:
    """Plan, and prove; whatever is raised becomes the reply."""
    began, motion, report = time.process_time(), None, None
    try:
        problem, progress = request.problem(first), FirstFound()
        budget, earlier = Budget(request.seconds, progress.ended), motions.get(request.earlier)
        found = plan_through(_planner(request.margin), problem, budget, progress, earlier)
        motion, words = found.trajectory, "" if found.failure is None else found.failure.detail
        if motion is not None:
            report = verify(request.standing(first), motion)
            words = "" if report.verified else "the motion that was found is refused"
    except Exception as error:
        words = named_reason(error)
    return ReplanReply(request.number, motion, report, words, time.process_time() - began)


@cache
def _planner(margin: float) -> Planner[Any]:
    return make_planner(PLANNER, {"margin": margin, **COARSE})


def _warm_up(first: FirstMotion) -> None:
    """Plan on the way, so that what is loaded and kept is there."""
    problem, motion = first.problem, first.motion
    passing = Obstacle("passing", Sphere(0.05), pin.SE3(np.eye(3), np.array([9.0, 0.0, 0.0])))
    for scene in (problem.scene, problem.scene.with_(passing.moving([[0.0], [0.0, 0.1], [0.0]]))):
        start = motion.state(0.1 * motion.duration)
        answer(ReplanRequest(0, 0, start, scene, MARGIN, 2.0), problem, {0: motion})
