"""Plan a task in which steps go with what moves, or wait for it: section by section, each at its time.

A meeting with the steps that go with it, a wait, or the steps between them are one section. Each begins where and when
the one before ends. After a ride the next one takes the motion over, or the arm comes to rest first.
"""

from collections.abc import Callable, Sequence
from dataclasses import field, replace
from typing import Any

import numpy as np

from optiplan.planners.base import Budget, Failure, Planner, PlanResult, Progress, stages_of
from optiplan.planners.common.context import Stopwatch
from optiplan.planners.seams.seam_motion import run_up
from optiplan.planners.task.chains import of_step
from optiplan.planners.task.planned_steps import PlannedStep, object_and_link, standing_still
from optiplan.planners.task.rides.meeting import MeetingSearch
from optiplan.planners.task.rides.riding import TimedPart, free_in_time, until_end
from optiplan.planners.task.stages import WorldState
from optiplan.problem.problem import Problem, derived
from optiplan.problem.task.rides import WaitUntil
from optiplan.problem.task.scene_change import scene_after
from optiplan.problem.task.steps import Event, Move, TaskStep
from optiplan.problem.task.tour_steps import in_order
from optiplan.records import dataclass
from optiplan.trajectory.joining import join_trajectories, standstill
from optiplan.trajectory.segments import Segment
from optiplan.trajectory.trajectory import Trajectory

PlanTask = Callable[[Planner[Any], Problem, Budget, Progress], PlanResult]
"""Plans the steps between rides; see `task.planner.plan_task`."""


def sections_in_time(task: Sequence[TaskStep]) -> list[list[TaskStep]]:
    """Divide a task into rides, waits, and the steps between them."""
    found: list[list[TaskStep]] = []
    for step in task:
        before = found[-1][0] if found else None
        alone = isinstance(step.action, WaitUntil) and step.ride is None
        meets = step.ride is not None and _meets(step)
        ended = before is not None and (before.ride is None) != (step.ride is None)
        waited = before is not None and isinstance(before.action, WaitUntil) and before.ride is None
        if not found or alone or meets or ended or waited:
            found.append([])
        found[-1].append(step)
    return found


def _meets(step: TaskStep) -> bool:
    ride, action = step.ride, step.action
    return ride is not None and isinstance(action, Move) and set(ride.joints) <= set(action.joints)


@dataclass(eq=False)
class TaskInTime:
    """One search, section by section.

    Attributes:
        problem: of the whole task.
        planner: of the moves.
        plan_task: plans the steps between rides.
        budget: of the whole.
    """

    problem: Problem
    planner: Planner[Any]
    plan_task: PlanTask
    budget: Budget
    progress: Progress
    info: dict[str, Any] = field(default_factory=lambda: {"attempts": 0, "cut_short": False})

    def run(self) -> PlanResult:
        """Return the motion of the whole task."""
        watch = Stopwatch()
        state, t = WorldState(self.problem.start, self.problem.scene), 0.0
        motions, segments = list[Trajectory](), list[Segment]()
        moving = False
        sections = sections_in_time(self.problem.task)
        for k, section in enumerate(sections):
            share = self.budget.share(1.0 / (len(sections) - k))
            stage = "meeting" if section[0].ride is not None else "steps"
            with watch.stage(stage):
                found = self._section(section, state, t, motions[-1] if moving else None, share, first=k == 0)
            self.info["cut_short"] |= self.budget.over
            if isinstance(found, Failure):
                return PlanResult(None, found, watch.seconds, self.info)
            segments += [replace(one, begin=one.begin + t, end=one.end + t) for one in found.segments]
            if found.motion is not None:
                motions.append(found.motion)
            state, t = found.after, t + found.duration
            moving = section[0].ride is not None
        if not motions:
            whole = standing_still(self.problem, self.problem.task, segments)
        else:
            whole = replace(join_trajectories(motions), segments=tuple(segments))
        return PlanResult(whole, None, watch.seconds, self.info)

    def _section(
        self,
        steps: Sequence[TaskStep],
        state: WorldState,
        t: float,
        before: Trajectory | None,
        budget: Budget,
        *,
        first: bool,
    ) -> TimedPart | Failure:
        action = steps[0].action
        if before is not None and steps[0].ride is None:
            found = self._taken_over(steps, state, t, before, budget.share(0.5))
            if isinstance(found, TimedPart):
                return found
        stopped = None if before is None else self._stopped(steps[0], state, t, before)
        if isinstance(stopped, Failure):
            return stopped
        since = 0.0 if stopped is None else stopped.duration
        begin = state if stopped is None else stopped.after
        if isinstance(action, WaitUntil) and steps[0].ride is None:
            found = self._wait(steps[0], action, begin, t + since)
        elif steps[0].ride is not None:
            meeting = MeetingSearch(self.problem, self.planner, steps, budget, stages_of(self.progress), self.info)
            found = meeting.run(begin, t + since)
        else:
            found = self._steps(steps, begin, t + since, budget, first=first)
        if isinstance(found, Failure) or stopped is None or stopped.motion is None:
            return found
        return _after(stopped.motion, found)

    def _taken_over(
        self, steps: Sequence[TaskStep], state: WorldState, t: float, before: Trajectory, budget: Budget
    ) -> TimedPart | Failure:
        """Return the steps after a ride, whose first move goes on from the motion of the ride."""
        v, a = (before(before.duration, order) for order in (1, 2))
        return self._steps(steps, state, t, budget, rates=(v, a))

    def _stopped(self, step: TaskStep, state: WorldState, t: float, before: Trajectory) -> TimedPart | Failure:
        """Return the arm coming to rest from the motion of a ride, as short as limits let it be."""
        end = np.array([before(before.duration, order) for order in range(3)])
        found = run_up(self.problem, end, out=True)
        if not isinstance(found, Trajectory):
            words = "the arm cannot come to rest from the motion with which it goes"
            return of_step(Failure("limits", words, {"q": state.q.tolist()}), step, state, self.problem.robot)
        touch = free_in_time(self.problem, state.scene, step, found, t, self.budget)
        if touch is not None:
            return of_step(touch, step, state, self.problem.robot)
        return TimedPart(found, (), WorldState(found.end, state.scene))

    def _wait(self, step: TaskStep, action: WaitUntil, state: WorldState, t: float) -> TimedPart | Failure:
        lasts = until_end(action, t)
        if isinstance(lasts, Failure):
            return of_step(lasts, step, state, self.problem.robot)
        own = Segment(step.number, step.kind, step.name, 0.0, lasts, *object_and_link(PlannedStep(step, state, state)))
        if lasts == 0.0:
            return TimedPart(None, (own,), state)
        motion = standstill(self.problem.robot.joint_names, state.q, lasts)
        touch = free_in_time(self.problem, state.scene, step, motion, t, self.budget)
        if touch is not None:
            return of_step(touch, step, state, self.problem.robot)
        self.info["waited"] = self.info.get("waited", 0.0) + lasts
        return TimedPart(motion, (own,), state)

    def _steps(
        self,
        steps: Sequence[TaskStep],
        state: WorldState,
        t: float,
        budget: Budget,
        *,
        first: bool = False,
        rates: tuple[Any, Any] | None = None,
    ) -> TimedPart | Failure:
        """Return steps in the world, planned as a task of their own that begins at time t, s."""
        own = derived(self.problem, task=tuple(steps), start=state.q, scene=state.scene.later(t))
        if not first:
            v, a = rates or (0.0 * state.q, 0.0 * state.q)
            own = derived(own, start_velocity=v, start_acceleration=a)
        result = self.plan_task(self.planner, own, budget, self.progress)
        if result.trajectory is None:
            return result.failure or Failure("no-path", "no motion was found")
        self.info["attempts"] += result.info.get("attempts", 0)
        self.info["cut_short"] |= bool(result.info.get("cut_short", False))
        motion = result.trajectory
        scene, plain = state.scene, in_order(own, motion)
        for step, segment in zip(plain.task, motion.segments, strict=True):
            if isinstance(step.action, Event):
                at = segment.end
                scene = scene_after(scene, step.action, self.problem.robot, motion(at, clamp=True), t + at)
        lasts = any(one.end > one.begin for one in motion.segments)
        bare = replace(motion, segments=()) if lasts else None  # events alone take no time
        return TimedPart(bare, motion.segments, WorldState(motion.end, scene))


def _after(stop: Trajectory, part: TimedPart) -> TimedPart:
    """Return a part whose first step begins with a stop."""
    since = stop.duration
    later = [replace(one, begin=one.begin + since, end=one.end + since) for one in part.segments]
    later[0] = replace(later[0], begin=0.0)
    motion = stop if part.motion is None else join_trajectories([stop, part.motion])
    return TimedPart(motion, tuple(later), part.after)
