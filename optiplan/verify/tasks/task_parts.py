"""The steps of a task in time, each with its own problem and its part of the motion."""

from collections.abc import Iterator
from dataclasses import replace
from functools import cached_property
from itertools import zip_longest
from operator import itemgetter

import numpy as np

from optiplan.arrays import Array
from optiplan.geometry.scene import Scene
from optiplan.problem.problem import Problem
from optiplan.problem.task.arms import steps_of_arms
from optiplan.problem.task.scene_change import scene_during
from optiplan.problem.task.steps import TaskStep
from optiplan.problem.task.timeline import part_problem, steps_in_time
from optiplan.records import dataclass
from optiplan.trajectory.joining import cut_trajectory, standstill
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.tasks.carriage import on_carriage, seen_from, state_seen_from
from optiplan.verify.tasks.line_ways import LineWay, frame_at, line_way


@dataclass(frozen=True, eq=False)
class StepPart:
    """A step in time.

    Attributes:
        step: the step.
        problem: its own, with the scene as it is when it begins.
        motion: while it is done; None where it takes no time.
        begin: s.
        q: (n,) at its end.
        v: (n,) velocity at its end.
        scene: in which it begins, with the motions of obstacles as they are stated.
        way: of a line.
    """

    step: TaskStep
    problem: Problem
    motion: Trajectory | None
    begin: float
    q: Array
    v: Array
    scene: Scene
    way: LineWay | None = None

    @property
    def end(self) -> float:
        """When it ends, s."""
        return self.begin + (0.0 if self.motion is None else self.motion.duration)

    def lasting(self) -> Trajectory:
        """The motion, or standing still for a second where the step takes no time."""
        return standing_at(self.problem, self.q) if self.motion is None else self.motion

    @cached_property
    def seen(self) -> "StepPart":
        """The part as it is seen from what the step goes with, which stands still there; itself of any other step."""
        if self.step.ride is None:
            return self
        motion = self.step.ride.mover.motion
        q, v = state_seen_from((self.q, self.v), motion, self.end)
        carried = on_carriage(self.problem, motion)
        own = None if self.motion is None else seen_from(self.motion, motion, self.begin, carried.robot)
        return replace(self, problem=carried, motion=own, q=q, v=v)


def standing_at(problem: Problem, q: Array) -> Trajectory:
    """Return a second at a configuration (n,)."""
    return standstill(problem.robot.joint_names, q, 1.0)


def step_parts(problem: Problem, trajectory: Trajectory) -> Iterator[StepPart]:
    """Return each step with its own part of the motion, None for an event or an empty part."""
    rows = list(steps_in_time(problem, trajectory))
    found: list[tuple[int, StepPart]] = []
    places_of = {id(step): k for k, step in enumerate(problem.task)}
    for places in steps_of_arms([row[0] for row in rows]).values():
        way: LineWay | None = None
        for k, after in zip_longest(places, places[1:]):
            step, scene, begin, end = rows[k]
            own = part_problem(problem, scene_during(scene.later(begin), step))
            motion = cut_trajectory(trajectory, begin, end) if end > begin else None
            v = trajectory(np.array([end]), 1)[0]
            part = StepPart(step, own, motion, begin, trajectory(end), v, scene)
            following = None if after is None else rows[after][0].action
            X = frame_at(part.seen.problem.robot, step.action, _first(part, trajectory(begin)))
            way = line_way(step.action, following, X, way)
            place = places_of[id(step)] if step.arm else k
            found.append((place, replace(part, way=way)))
    yield from (part for _, part in sorted(found, key=itemgetter(0)))


def _first(part: StepPart, q: Array) -> Array:
    """Return the configuration in which a part begins, as it is seen from what the step goes with."""
    if part.step.ride is None:
        return q
    return state_seen_from((q, q), part.step.ride.mover.motion, part.begin)[0]
