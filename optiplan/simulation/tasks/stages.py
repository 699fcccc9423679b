"""Stages of a task in a closed loop: in each, the scene, the loads and the grips stay the same."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field, replace

import numpy as np

from optiplan.arrays import Array
from optiplan.problem.problem import Problem
from optiplan.problem.task.scene_change import scene_after
from optiplan.problem.task.steps import Attach, Event, Move, TaskStep
from optiplan.problem.task.timeline import part_problem, scene_parts, steps_in_time
from optiplan.records import dataclass
from optiplan.trajectory.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class TaskStage:
    """A stretch of a motion.

    Attributes:
        begin: place on the path where it begins, s of the planned motion.
        problem: of the plan here: its scene, and the robot with what it carries.
        actions: what is taken and released as it begins.
        fingers: that hold objects: joint index and direction in which it closes, 1 or -1, by the object.
        pressed: objects on which their fingers press.
    """

    begin: float
    problem: Problem
    actions: tuple[Event, ...] = ()
    fingers: Mapping[str, Mapping[int, float]] = field(default_factory=dict)
    pressed: frozenset[str] = frozenset()


def stages_of(problem: Problem, trajectory: Trajectory) -> list[TaskStage]:
    """Return the stages of a motion, in order; one of a motion to a goal.

    Raises:
        ValueError: the segments of the motion are not the steps of the task.
    """
    if not problem.task:
        return [TaskStage(0.0, problem)]
    found = [TaskStage(part.begin, part.problem) for part in scene_parts(problem, trajectory)]
    last = problem.scene
    for step, scene, begin, _ in steps_in_time(problem, trajectory):
        last = scene
        if not isinstance(step.action, Event):
            continue
        last = scene_after(scene, step.action, problem.robot, trajectory(begin), begin)
        k = int(np.searchsorted([stage.begin for stage in found], begin))
        if k == len(found):
            found.append(TaskStage(begin, part_problem(problem, last.later(begin))))
        elif k == len(found) - 1 and found[k].begin == trajectory.duration:  # several events at the end
            found[k] = replace(found[k], problem=part_problem(problem, last.later(begin)))
        found[k] = replace(found[k], actions=(*found[k].actions, step.action))
    return _with_grips(found, problem, trajectory)


def stage_at(stages: Sequence[TaskStage], places: Array) -> Array:
    """Return the index of the stage at places (K,), s of the planned motion: (K,)."""
    begins = np.array([stage.begin for stage in stages])
    return np.maximum(np.searchsorted(begins, places, side="right") - 1, 0)


@dataclass(frozen=True)
class _Grip:
    """An object in a gripper: taken, pressed, no longer pressed, released; times of the planned motion, s."""

    name: str
    joints: Mapping[int, float]
    taken: float
    closed: float
    opens: float
    released: float


def _with_grips(stages: list[TaskStage], problem: Problem, trajectory: Trajectory) -> list[TaskStage]:
    """Return the stages with fingers that hold, cut where they begin and end to press."""
    for grip in _grips(problem, trajectory):
        for cut in (grip.closed, grip.opens):
            k = int(stage_at(stages, np.array([cut]))[0])
            if stages[k].begin != cut and cut < trajectory.duration:
                stages.insert(k + 1, replace(stages[k], begin=cut, actions=()))
        for k, stage in enumerate(stages):
            if grip.taken <= stage.begin < grip.released:
                stages[k] = stage = replace(stage, fingers={**stage.fingers, grip.name: grip.joints})
            if grip.closed <= stage.begin < grip.opens:
                stages[k] = replace(stage, pressed=stage.pressed | {grip.name})
    return stages


_Row = tuple[TaskStep, float, float]
"""A step, its begin and its end, s."""


def _grips(problem: Problem, trajectory: Trajectory) -> Iterator[_Grip]:
    """Return the objects that a gripper closes on right after they are taken.

    It presses until it opens, right before they are released, or until they are.
    """
    found = [(step, begin, end) for step, _, begin, end in steps_in_time(problem, trajectory)]
    for arm in dict.fromkeys(step.arm for step, _, _ in found):
        yield from _grips_of([row for row in found if row[0].arm == arm], problem, trajectory)


def _grips_of(rows: list[_Row], problem: Problem, trajectory: Trajectory) -> Iterator[_Grip]:
    for k, (step, taken, _) in enumerate(rows):
        closing = _first_gripper(rows[k + 1 :]) if isinstance(step.action, Attach) else None
        if closing is None:
            continue
        name = step.action.body  # type: ignore[union-attr]
        later = range(k + 1, len(rows))
        release = next((j for j in later if getattr(rows[j][0].action, "body", "") == name), len(rows))
        released = rows[release][1] if release < len(rows) else np.inf
        opening = _first_gripper(rows[k + 1 : release][::-1]) if release < len(rows) else None
        opens = opening[1] if opening is not None and opening[1] > closing[1] else released
        joints = _closing_joints(problem, closing[0], np.asarray(trajectory(closing[2]) - trajectory(closing[1])))
        if joints:
            yield _Grip(name, joints, taken, closing[2], opens, released)


def _first_gripper(rows: Sequence[_Row]) -> _Row | None:
    """Return the first row if it moves a gripper, events apart."""
    row = next((row for row in rows if not row[0].event), None)
    return row if row is not None and row[0].kind == "gripper" else None


def _closing_joints(problem: Problem, step: TaskStep, by: Array) -> dict[int, float]:
    assert isinstance(step.action, Move)
    columns = [problem.robot.joint_names.index(joint) for joint in step.action.joints]
    return {j: float(np.sign(by[j])) for j in columns if by[j] != 0.0}
