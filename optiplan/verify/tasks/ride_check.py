"""The check of steps that go with what moves: relative to it the tool rests where it has to, at the right moments."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from optiplan.arrays import Array
from optiplan.problem.constraints.motions import ToolSpeed
from optiplan.problem.constraints.points import OnLine
from optiplan.problem.constraints.poses import OrientationCone
from optiplan.problem.problem import Problem, derived
from optiplan.problem.task.rides import Ride, WaitUntil
from optiplan.problem.task.steps import Attach, Detach, Event, Move, StraightLine, TaskStep
from optiplan.robot.frames import frame_pose
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.constraint_check import path_constraints
from optiplan.verify.continuous.frame_motion import FrameMotion
from optiplan.verify.report import Check, VerifyPolicy
from optiplan.verify.statements import covering, step_place
from optiplan.verify.tasks.line_ways import EVENLY, STRAIGHT
from optiplan.verify.tasks.task_parts import StepPart

RIDING = 1e-3, 5e-3
"""m/s and rad/s: how fast a frame may move against what it goes with where it has to rest there."""


def ride_checks(parts: Sequence[StepPart], policy: VerifyPolicy) -> Iterator[Check]:
    """Yield checks of the steps that go with what moves, and of those that take it.

    Seen from what the step goes with, the frame rests at its end, and where the step does not lead it, it rests at all
    times: within 0.1 mm, 1 mrad, 1 mm/s and 5 mrad/s. Where the step leads it is checked as of any line or end of a
    move, in that frame. What is taken moves with it.
    """
    for k, part in enumerate(parts):
        step, ride = part.step, part.step.ride
        covers = f"{step_place(k)}.ride"
        if isinstance(step.action, Attach) and (wrong := _taken(part, step.action, ride)):
            yield covering(Check("ride", "exact", False, time=part.begin, detail=f"{step.words}: {wrong}"), covers)
        if ride is None:
            continue
        yield covering(_rest_at_end(part, ride), covers)
        if part.motion is not None and not leads(step, ride):
            for check in path_constraints(*_held(part, ride), policy):
                time = None if check.time is None else check.time + part.begin
                detail = f"{step.words}: {check.detail}"
                yield covering(replace(check, name="ride", time=time, detail=detail, covers=()), covers)


def wait_failures(parts: Sequence[StepPart]) -> Iterator[str]:
    """Yield in words which conditions do not hold at the end of the step that waits for them."""
    for part in parts:
        action = part.step.action
        if isinstance(action, WaitUntil) and not action.holds(part.end):
            yield f"{part.step.words} ends at {part.end:.6g} s, when {action.words} does not hold"


def leads(step: TaskStep, ride: Ride) -> bool:
    """Whether a step leads the frame that goes with something, rather than keeping it there."""
    action = step.action
    return isinstance(action, Move | StraightLine) and set(ride.joints) <= set(action.joints)


def _taken(part: StepPart, action: Attach, ride: Ride | None) -> str:
    """Return in words how what is taken does not move with the robot; empty where it does."""
    motions = [one.motion for one in part.scene.obstacles if one.name == action.body]
    motion = motions[0] if motions else None
    if motion is None or motion.until <= part.begin:
        return "" if ride is None or ride.mover.motion.until <= part.begin else f"'{action.body}' stands still"
    if ride is None:
        return f"'{action.body}' moves, and the arm does not go with it"
    return "" if motion.key == ride.mover.motion.key else f"'{action.body}' moves otherwise than '{ride.mover.name}'"


def _rest_at_end(part: StepPart, ride: Ride) -> Check:
    """Check that the frame rests at the end of a step, as it is seen from what it goes with."""
    seen = part.seen
    motion = FrameMotion(seen.problem.robot, ride.frame)
    linear, angular = (float(np.linalg.norm(rate)) for rate in motion.twists(seen.q[None], seen.v[None]))
    turns = angular / RIDING[1] > linear / RIDING[0]
    worst, limit, unit = (angular, RIDING[1], "rad/s") if turns else (linear, RIDING[0], "m/s")
    event = isinstance(part.step.action, Attach | Detach | Event)
    moment = "as it is taken or released" if event else "at the end"
    detail = f"{part.step.words}: against '{ride.mover.name}' {moment}"
    return Check("ride", "exact", worst <= limit, worst, limit, unit, part.end, ride.frame, detail)


def _held(part: StepPart, ride: Ride) -> tuple[Problem, Trajectory]:
    """Return the problem and the motion of a step in which the frame rests against what it goes with."""
    seen = part.seen
    lasting = seen.lasting()
    X = frame_pose(seen.problem.robot, lasting.start, ride.frame)
    axes: list[Array] = list(np.eye(3)[:2])
    stated = (
        OnLine(ride.frame, X.translation, X.translation, STRAIGHT),
        *(OrientationCone(ride.frame, axis, X.rotation @ axis, EVENLY) for axis in axes),
        ToolSpeed(ride.frame, *RIDING),
    )
    error = np.zeros(lasting.n)
    return derived(seen.problem, path_constraints=stated, tracking_error=error), lasting
