"""Steps of a task that are planned: events, motions, motions of several steps in one go, and all as one motion."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

from optiplan.planners.path_constraints.tool_limits import all_tool_limits
from optiplan.planners.task.blends import Corner
from optiplan.planners.task.stages import Stage, WorldState
from optiplan.problem.problem import Problem
from optiplan.problem.task.steps import Attach, ChangeTool, Detach, StraightLine, TaskStep
from optiplan.records import dataclass
from optiplan.trajectory.joining import join_trajectories, standstill, with_resting_joints
from optiplan.trajectory.segments import Segment
from optiplan.trajectory.timing.path_constraints import ToolLimits
from optiplan.trajectory.tolerances import SHORTEST_DURATION
from optiplan.trajectory.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class PlannedStep:
    """A step that can be done; on its own an event or a dwell, in which no joint moves.

    Attributes:
        step: the step.
        before: state in which it begins.
        after: state in which it ends.
    """

    step: TaskStep
    before: WorldState
    after: WorldState


@dataclass(frozen=True, eq=False)
class PlannedMotion(PlannedStep):
    """A step in which joints move.

    Attributes:
        stage: of the joints that move.
        curve: their motion over time; of a line, their path over s from 0 to 1.
        corner: rounded corner at the end of a line: the line ends, and the next one begins, in its middle.
    """

    stage: Stage
    curve: Trajectory
    corner: Corner | None = None

    @property
    def is_line(self) -> bool:
        """Whether `curve` is the path of a line."""
        return isinstance(self.step.action, StraightLine)

    @cached_property
    def tool_limits(self) -> tuple[ToolLimits, ...]:
        """Limits of frames along a line: its own speed, and constraints of speed; none of a move."""
        action = self.step.action
        if not isinstance(action, StraightLine):
            return ()
        return all_tool_limits(self.stage.problem, action.frame, action.speed)


@dataclass(frozen=True, eq=False)
class Pause:
    """A step in which no joint moves, and how long it takes, s."""

    step: PlannedStep
    duration: float

    @property
    def steps(self) -> tuple[PlannedStep]:
        """The step, as of a stretch."""
        return (self.step,)

    @property
    def ends(self) -> tuple[float]:
        """When the step ends, as of a stretch."""
        return (self.duration,)


@dataclass(frozen=True, eq=False)
class Stretch:
    """Steps that are one motion of the same joints, from rest to rest.

    Attributes:
        steps: the steps.
        motion: of the joints of their stage.
        ends: when each of the steps ends, s from the beginning.
    """

    steps: tuple[PlannedMotion, ...]
    motion: Trajectory
    ends: tuple[float, ...]

    @classmethod
    def of(cls, step: PlannedMotion, motion: Trajectory) -> "Stretch":
        """Return a step alone."""
        return cls((step,), motion, (motion.duration,))

    @property
    def duration(self) -> float:
        """Duration of the motion, s."""
        return self.ends[-1]


TaskPart = Stretch | Pause
"""A part of a task's motion that begins and ends at rest."""

Group = list[Stretch] | Pause
"""Stretches between which the arm need not stop, or a pause."""


def object_and_link(planned: PlannedStep) -> tuple[str, str]:
    """Return the object that is taken or released, and the link that holds it; empty for other steps."""
    action = planned.step.action
    if isinstance(action, Attach | ChangeTool):
        return action.body, action.link
    if isinstance(action, Detach):
        return action.body, next(held.link for held in planned.before.scene.attached if held.name == action.body)
    return "", ""


def joined_parts(problem: Problem, parts: Sequence[TaskPart]) -> Trajectory:
    """Join parts, each at rest at both ends, to one motion of all joints, with its segments."""
    motions: list[Trajectory] = []
    segments: list[Segment] = []
    begin = 0.0
    for part in parts:
        q = part.steps[0].before.q
        if isinstance(part, Stretch):
            motions.append(with_resting_joints(part.motion, part.steps[0].stage.columns, problem.robot.joint_names, q))
        elif part.duration > 0.0:
            motions.append(standstill(problem.robot.joint_names, q, part.duration))
        since = begin
        for planned, end in zip(part.steps, part.ends, strict=True):
            step, held = planned.step, object_and_link(planned)
            segments.append(Segment(step.number, step.kind, step.name, since, begin + end, *held))
            since = begin + end
        begin = since
    if not motions:
        return standing_still(problem, [planned.step for part in parts for planned in part.steps], segments)
    return replace(join_trajectories(motions), segments=tuple(segments))


def standing_still(problem: Problem, steps: Sequence[TaskStep], segments: Sequence[Segment]) -> Trajectory:
    """Return the motion of steps in which nothing moves: the last one that is no event takes the shortest time."""
    T, last = SHORTEST_DURATION, max((k for k, step in enumerate(steps) if not step.event), default=len(steps))
    timed = [replace(one, begin=T * (k > last), end=T * (k >= last)) for k, one in enumerate(segments)]
    return replace(standstill(problem.robot.joint_names, problem.start, T), segments=tuple(timed))
