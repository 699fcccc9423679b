"""Check `standstill`: what a step does not move stands still, all of its arm at events and where a move rests."""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from itertools import chain
from typing import NamedTuple

import numpy as np

from optiplan.problem.problem import Problem
from optiplan.problem.seams.actions import SeamPart, Transit
from optiplan.problem.task.arms import joints_of_arms
from optiplan.problem.task.rides import WaitUntil
from optiplan.problem.task.steps import Dwell, Event, Move, StraightLine
from optiplan.robot.limits import joint_units
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.report import Check, VerifyPolicy
from optiplan.verify.statements import covering, step_place
from optiplan.verify.tasks.ride_check import wait_failures
from optiplan.verify.tasks.task_parts import StepPart


class _Moved(NamedTuple):
    """How far a joint that should stand still moves in a step, rad or m; and when the step begins, s."""

    way: float
    unit: str
    time: float
    place: str


def standstill(problem: Problem, trajectory: Trajectory, parts: Sequence[StepPart], policy: VerifyPolicy) -> Check:
    """Check that joints which a step does not move stand still, all of them at events and where a move rests.

    A dwell has to last, and a wait until its condition holds. Joints that go with what moves are checked by `ride`.

    Standing still is moving by no more than `jump_tolerance` over the whole step, from the exact extrema.
    """
    arms = joints_of_arms(problem.task, problem.robot.joint_names)
    still = _Moved(0.0, joint_units("position", problem.robot.revolute), 0.0, "")
    most = max([still, *_moved(problem, parts, arms)], key=lambda one: one.way)
    failed = next(chain(wait_failures(parts), _not_at_rest(problem, trajectory, parts, arms, policy)), "")
    limit = policy.jump_tolerance
    detail = failed or "joints that a step does not move, and all of them at events"
    passed = most.way <= limit and not failed
    found = Check("standstill", "exact", passed, most.way, limit, most.unit, most.time, most.place, detail)
    return covering(found, *(f"{step_place(k)}.{one}" for k, part in enumerate(parts) for one in _statements(part)))


def _statements(part: StepPart) -> Iterator[str]:
    """Yield the statements of a step that are about standing still."""
    action = part.step.action
    yield "standstill"
    if isinstance(action, Event) and part.motion is None:
        yield "event"
    if isinstance(action, Dwell):
        yield "dwell"
    if isinstance(action, WaitUntil):
        yield "wait_until"
    if isinstance(action, Move) and action.rests:
        yield "rest"


def _moved(problem: Problem, parts: Iterable[StepPart], arms: Mapping[str, Sequence[int]]) -> Iterator[_Moved]:
    """Yield, of each step that takes time, the joint that moves most among those that the step does not move."""
    for part in parts:
        action = part.step.action
        moving = action.joints if isinstance(action, Move | StraightLine | Transit | SeamPart) else ()
        own = _others(problem, part, arms, moving)
        if part.motion is not None and own:
            low, high = part.motion.extrema(0)
            ways = (high - low)[own]
            unit = problem.robot.unit("position", own[int(ways.argmax())])
            yield _Moved(float(ways.max()), unit, part.begin, part.step.words)


def _not_at_rest(
    problem: Problem,
    trajectory: Trajectory,
    parts: Iterable[StepPart],
    arms: Mapping[str, Sequence[int]],
    policy: VerifyPolicy,
) -> Iterator[str]:
    """Yield in words at which ends and events joints move that should rest, and which dwells are too short."""

    def moves(time: float, joints: Sequence[int]) -> bool:
        speed = np.abs(trajectory(np.array([time]), 1)[0]) / problem.limits.velocity
        return bool(speed[list(joints)].max(initial=0.0) > policy.rest_tolerance)

    for part in parts:
        action, words = part.step.action, part.step.words
        lasts = 0.0 if part.motion is None else part.motion.duration
        if isinstance(action, Move) and action.rests and moves(part.begin + lasts, range(problem.robot.n)):
            yield f"the robot moves at the end of {words}"
        if isinstance(action, Event) and part.motion is None and moves(part.begin, _others(problem, part, arms)):
            yield f"the robot moves at the event of {words}"
        if isinstance(action, Dwell) and part.motion is None:
            yield f"{words} does not last"
        elif isinstance(action, Dwell) and lasts < action.seconds * (1.0 - 1e-9):
            yield f"{words} lasts {lasts:.6g} s of {action.seconds:g} s"


def _others(
    problem: Problem, part: StepPart, arms: Mapping[str, Sequence[int]], moving: Collection[str] = ()
) -> list[int]:
    """Return the joints of the step's arm, by index, but those that move and those that go with what moves."""
    riding = () if part.step.ride is None else part.step.ride.joints
    return [j for j in arms[part.step.arm] if problem.robot.joint_names[j] not in {*moving, *riding}]
