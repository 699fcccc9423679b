"""Tasks of several arms: each does its own steps in their order, beside the others, and waits for some of theirs.

The segments of a motion say when each step is done. Between two steps of an arm, and after its last one, it waits.
"""

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from operator import attrgetter

import numpy as np

from optiplan.arrays import Array
from optiplan.problem.task.steps import Move, StraightLine, TaskStep
from optiplan.trajectory.segments import Segment

Task = Sequence[TaskStep]


def several_arms(task: Task) -> bool:
    """Return whether steps are done by several arms beside each other."""
    return any(step.arm for step in task)


def steps_of_arms(task: Task) -> dict[str, list[int]]:
    """Return the places in the task of the steps of each arm; of a task without arms all steps, of the arm ``."""
    found: dict[str, list[int]] = {}
    for k, step in enumerate(task):
        found.setdefault(step.arm, []).append(k)
    return found


def joints_of_arms(task: Task, names: Sequence[str]) -> dict[str, list[int]]:
    """Return the places in a configuration of the joints that some step of each arm moves; without arms all."""
    if not several_arms(task):
        return {"": list(range(len(names)))}
    moved: dict[str, set[str]] = {step.arm: set() for step in task}
    for step in task:
        if isinstance(step.action, Move | StraightLine):
            moved[step.arm] |= set(step.action.joints)
    return {arm: [k for k, name in enumerate(names) if name in joints] for arm, joints in moved.items()}


def of_one_arm(arm: str, columns: Mapping[str, Sequence[int]], q: Array) -> Array:
    """Return a configuration (n,) in which joints that other arms move are nan; `columns` as of `joints_of_arms`."""
    known = np.array(q, dtype=float)
    known[[k for other, moved in columns.items() if other != arm for k in moved]] = np.nan
    return known


def in_task_order(task: Task, segments: Sequence[Segment]) -> tuple[Segment, ...]:
    """Return the segments of a motion in the order of the task; they stand in the order of their times."""
    return tuple(sorted(segments, key=attrgetter("step")) if several_arms(task) else segments)


def in_time_order(task: Task, segments: Sequence[Segment]) -> tuple[Segment, ...]:
    """Return the segments in the order of their beginnings; of those that begin together in that of the task."""
    return tuple(sorted(segments, key=lambda one: (one.begin, one.step)) if several_arms(task) else segments)


def arms_mismatch(task: Task, segments: Sequence[Segment], T: float) -> str:
    """Return in words how arms do not do their steps in order and wait where they have to; empty if they do.

    Args:
        task: with arms.
        segments: one of each step, in the order of the task.
        T: duration of the motion, s.
    """
    for places in steps_of_arms(task).values():
        own = [segments[k] for k in places]
        for before, after in pairwise(own):
            if not after.begin >= before.end:
                return f"step {after.step} begins at {after.begin:.6g} s; the one before ends at {before.end:.6g} s"
        if not (own[0].begin >= 0.0 and own[-1].end <= T):
            return f"steps of one arm from {own[0].begin:.6g} to {own[-1].end:.6g} s of {T:.6g} s"
    return next(unmet_waits(task, segments), "")


def unmet_waits(task: Task, segments: Sequence[Segment]) -> Iterator[str]:
    """Yield in words each step that begins before one ends for which it waits; segments in the order of the task."""
    ends: Mapping[int, float] = {one.step: one.end for one in segments}  # the last part of a step ends last
    for step, segment in zip(task, segments, strict=True):
        for number in step.waits:
            if not segment.begin >= ends[number]:
                begin, end = segment.begin, ends[number]
                yield f"{step.words} begins at {begin:.6g} s; step {number}, for which it waits, ends at {end:.6g} s"
