"""Vias as moves: a motion past points is a task whose moves go from each of them to the next."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from optiplan.planners.base import Failure, Planner
from optiplan.problem.constraints.base import WHOLE
from optiplan.problem.problem import Problem, derived
from optiplan.problem.seams.actions import SeamPath
from optiplan.problem.task.steps import Event, Move, TargetTour, TaskStep
from optiplan.records import dataclass
from optiplan.trajectory.segments import Segment
from optiplan.trajectory.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class ViaLeg(TaskStep):
    """A move of a problem that has vias and no task.

    Attributes:
        count: of the legs.
    """

    count: int = 1

    @property
    def words(self) -> str:
        """The leg as messages name it."""
        return f"leg {self.number} of {self.count}, {self.name}"


@dataclass(frozen=True, eq=False)
class ViaMoves:
    """A problem whose vias are moves.

    Attributes:
        problem: its task has a move to each via and one to the goal.
        counts: moves that stand for each step of the task as it was, of a tour or path one for each of its segments;
            empty where there was no task.
    """

    problem: Problem
    counts: tuple[int, ...]

    @classmethod
    def of(cls, problem: Problem, planner: Planner[Any]) -> "ViaMoves":
        """Return a problem with vias, or with a task, of whose moves those past vias are several."""
        if problem.vias:
            ends = [*(via.goal for via in problem.vias), problem.goal]
            names = ["the start", *(f"via {k}" for k in range(1, len(ends))), "the goal"]
            legs = [
                ViaLeg(
                    k,
                    "leg",
                    f"from {names[k - 1]} to {names[k]}",
                    Move(problem.robot.joint_names, end),
                    count=len(ends),
                )
                for k, end in enumerate(ends, 1)
            ]
            return cls(derived(problem, vias=(), task=tuple(legs)), ())
        parts = [_moves(step) if planner.joins_legs else [step] for step in problem.task]
        task = tuple(one for part in parts for one in part)
        counts = [
            (1,) * one.action.count if isinstance(one.action, TargetTour | SeamPath) else (len(part),)
            for one, part in zip(problem.task, parts, strict=True)
        ]
        return cls(derived(problem, task=task), tuple(count for own in counts for count in own))

    def motion(self, motion: Trajectory) -> Trajectory:
        """Return a motion with the segments of the task as it was, or without any."""
        found: list[Segment] = []
        rest = list(motion.segments)
        for count in self.counts:
            own, rest = rest[:count], rest[count:]
            found.append(replace(own[-1], begin=own[0].begin))
        return replace(motion, segments=tuple(found))

    def failure(self, failure: Failure | None) -> Failure | None:
        """Return a failure of a leg that has the leg's number as `leg` of its witness."""
        if failure is None or self.counts or "step" not in failure.witness:
            return failure
        rest = {key: value for key, value in failure.witness.items() if key not in ("step", "step_name")}
        return replace(failure, witness={**rest, "leg": failure.witness["step"]})


def unsupported(problem: Problem, planner: Planner[Any]) -> Failure | None:
    """Return why a problem cannot be planned leg by leg: a constraint on a part of what becomes several moves."""
    lasting = [step for step in problem.task if not isinstance(step.action, Event)]
    several = len(lasting) > 1 or any(isinstance(step.action, TargetTour | SeamPath) for step in lasting)
    if several and any(tuple(one.during) != WHOLE for one in problem.path_constraints):
        words = "constraints on a part of a task are not held where it has several steps; expected them of its steps"
        return Failure("unsupported", words)
    held = [problem.path_constraints] if problem.vias else []
    legs = [step for step in lasting if planner.joins_legs and isinstance(step.action, Move) and step.action.vias]
    held += [(*problem.path_constraints, *step.constraints) for step in legs]
    if all(tuple(one.during) == WHOLE for constraints in held for one in constraints):
        return None
    return Failure("unsupported", "this planner holds constraints on a part of the motion only where there are no vias")


def _moves(step: TaskStep) -> Sequence[TaskStep]:
    """Return a step as moves to each of its vias and to its goal; the first one waits for other arms, if it does."""
    action = step.action
    if not isinstance(action, Move):
        return [step]
    ends = [*(via.goal for via in action.vias), action.goal]
    moves = [replace(step, action=Move(action.joints, end)) for end in ends]
    return [moves[0], *(replace(one, waits=()) for one in moves[1:])]
