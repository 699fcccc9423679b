"""Do a task section by section: its tours, and the steps between them."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import field, replace
from typing import Any

from optiplan.planners.base import Budget, Failure, Planner, Progress, stages_of
from optiplan.planners.common.context import Stopwatch
from optiplan.planners.common.failures import path_too_heavy
from optiplan.planners.seams.seam_search import FoundSeam, SeamSearch
from optiplan.planners.task.chains import of_step
from optiplan.planners.task.planned_steps import Pause, PlannedMotion, PlannedStep, Stretch, TaskPart
from optiplan.planners.task.search import TaskSearch
from optiplan.planners.task.stages import Stages, WorldState
from optiplan.planners.tours.search import FoundTour, TourSearch
from optiplan.problem.problem import Problem, derived
from optiplan.problem.seams.actions import Passing, SeamPath
from optiplan.problem.seams.seam_steps import seam_steps
from optiplan.problem.task.steps import Dwell, TargetTour, TaskStep
from optiplan.problem.task.tour_steps import tour_steps
from optiplan.records import dataclass
from optiplan.trajectory.timing.time_path import TimingOptions, time_path

_TOUR = 0.9
"""Share of the remaining time that the last section may take if it is a tour; the rest joins steps and parts."""

Section = Sequence[TaskStep]


def sections_of(task: Sequence[TaskStep]) -> list[Section]:
    """Divide a task: every tour and path alone, and the steps before, between and after them."""
    found: list[list[TaskStep]] = []
    for step in task:
        alone = isinstance(step.action, TargetTour | SeamPath)
        if alone or not found or isinstance(found[-1][0].action, TargetTour | SeamPath):
            found.append([])
        found[-1].append(step)
    return list(found)


@dataclass(eq=False)
class SectionPlanner:
    """Plans the sections one after another, each from where the one before ends.

    Attributes:
        problem: of the whole task.
        found: called with the parts of the whole whenever a better tour is found that ends the task.
        moves: records of the planned moves.
        info: `attempts`, `cut_short`, and of tours what `TourSearch` says.
    """

    problem: Problem
    planner: Planner[Any]
    budget: Budget
    progress: Progress
    found: Callable[[Sequence[TaskPart]], object]
    moves: list[dict[str, Any]] = field(default_factory=list)
    info: dict[str, Any] = field(default_factory=lambda: {"attempts": 0, "cut_short": False})

    def run(self, watch: Stopwatch) -> list[TaskPart] | Failure:
        """Return all steps as parts, each from rest to rest, or the failure of the step that cannot be done."""
        state = WorldState(self.problem.start, self.problem.scene)
        sections = sections_of(self.problem.task)
        parts: list[TaskPart] = []
        for k, section in enumerate(sections):
            share = self.budget if len(sections) == 1 else self.budget.share(1.0 / (len(sections) - k))
            action = section[0].action
            if isinstance(action, TargetTour):
                with watch.stage("tour"):
                    last = k == len(sections) - 1
                    done = self._tour(section[0], action, state, share.share(_TOUR), parts if last else None)
            elif isinstance(action, SeamPath):
                with watch.stage("path"):
                    done = self._path(section[0], action, state, share.share(_TOUR))
            else:
                done = self._steps(section, state, share, watch, first=k == 0)
            if isinstance(done, Failure):
                return done
            parts += done
            state = parts[-1].steps[-1].after
        return parts

    def _steps(
        self, steps: Section, state: WorldState, budget: Budget, watch: Stopwatch, *, first: bool
    ) -> list[TaskPart] | Failure:
        own = derived(self.problem, task=tuple(steps), start=state.q, scene=state.scene)
        if not first:
            still = {"start_velocity": 0.0 * state.q, "start_acceleration": 0.0 * state.q}
            own = derived(own, **still)
        search = TaskSearch(own, self.planner, budget, stages_of(self.progress))
        with watch.stage("steps"):
            planned = search.run()
        self.moves += search.infos
        self.info["attempts"] += search.attempts
        self.info["cut_short"] |= search.cut_short or search.hurried
        if isinstance(planned, Failure):
            return planned
        parts: list[TaskPart] = []
        with watch.stage("timing"):
            for step in planned:
                timed = timed_step(step, budget)
                if isinstance(timed, Failure):
                    return timed
                parts.append(timed)
        return parts

    def _path(self, step: TaskStep, path: SeamPath, state: WorldState, budget: Budget) -> list[TaskPart] | Failure:
        """Return the parts of a path: the way to it, and the motion along it."""
        stages = Stages(self.problem)
        stage = stages.at(state, step, path.joints)
        told = stages_of(self.progress)
        search = SeamSearch(stage.problem, path, stage.model, self.planner, self.budget, budget, told)
        found = search.run()
        self.info.setdefault("paths", []).append(search.info)
        if isinstance(found, Failure):
            return of_step(found, step, state, self.problem.robot, stage)
        return _parts_of_path(stages, step, path, state, found)

    def _tour(
        self, step: TaskStep, tour: TargetTour, state: WorldState, budget: Budget, before: list[TaskPart] | None
    ) -> list[TaskPart] | Failure:
        """Return the parts of a tour; `before` are those before it where it ends the task."""
        stages = Stages(self.problem)
        stage = stages.at(state, step, tour.joints)

        def parts_of(found: FoundTour) -> list[TaskPart]:
            return list(_parts(stages, step, tour, state, found))

        def better(found: FoundTour) -> None:
            if before is not None:
                self.found([*before, *parts_of(found)])

        told = stages_of(self.progress)
        search = TourSearch(stage.problem, tour, stage.model, self.planner, budget, told, better, self.budget)
        found = search.run()
        self.info |= search.info | {"cut_short": self.info["cut_short"] or search.info.get("cut_short", False)}
        if isinstance(found, Failure):
            return of_step(found, step, state, self.problem.robot, stage)
        return parts_of(found)


def _parts(stages: Stages, step: TaskStep, tour: TargetTour, state: WorldState, found: FoundTour) -> Iterator[TaskPart]:
    """Yield the steps of a tour as parts: motions from rest to rest, and pauses."""
    legs = iter(found.legs)
    begin = stages.at(state, step, tour.joints)
    for own in tour_steps(step, tour, found.order, begin.problem.start):
        if isinstance(own.action, Dwell):
            yield Pause(PlannedStep(own, state, state), own.action.seconds)
            continue
        leg = next(legs)
        if leg is None:
            yield Pause(PlannedStep(own, state, state), 0.0)
            continue
        stage = stages.at(state, own, tour.joints)
        after = stage.arrived(leg.end, state)
        yield Stretch.of(PlannedMotion(own, state, after, stage, leg), leg)
        state = replace(after)


def _parts_of_path(
    stages: Stages, step: TaskStep, path: SeamPath, state: WorldState, found: FoundSeam
) -> list[TaskPart]:
    """Return the steps of a path as parts: the way to it from rest to rest, and all that follows in one motion."""
    first, *rest = seam_steps(step, path)
    stage = stages.at(state, first, path.joints)
    parts: list[TaskPart] = []
    if found.approach is None:
        parts.append(Pause(PlannedStep(first, state, state), 0.0))
    else:
        after = stage.arrived(found.approach.end, state)
        parts.append(Stretch.of(PlannedMotion(first, state, after, stage, found.approach), found.approach))
        state = after
    begins = iter(found.times.tolist())
    ends: list[float] = []
    planned: list[PlannedMotion] = []
    for own in rest:
        isolated = isinstance(own.action, Passing)
        ends.append(ends[-1] if isolated else next(begins, found.motion.duration))
        after = stage.arrived(found.motion(ends[-1], clamp=True), state)
        planned.append(PlannedMotion(own, state, after, stages.at(state, own, path.joints), found.motion))
        state = after
    return [*parts, Stretch(tuple(planned), found.motion, tuple(ends))]


def timed_step(planned: PlannedStep, budget: Budget) -> TaskPart | Failure:
    """Return a step from rest to rest; a line is timed within the limits of joints and tool."""
    if not isinstance(planned, PlannedMotion):
        action = planned.step.action
        return Pause(planned, action.seconds if isinstance(action, Dwell) else 0.0)
    if not planned.is_line:
        return Stretch.of(planned, planned.curve)
    problem, path = planned.stage.problem, planned.curve
    own, others = next(iter(planned.tool_limits), None), planned.tool_limits[1:]
    options = TimingOptions(None, own, tuple((0.0, 1.0, one) for one in others), stop=lambda: budget.over)
    motion = time_path(path, problem.robot, problem.limits, options)
    if motion is None:
        heavy = path_too_heavy(problem.robot, problem.limits, path)
        return of_step(heavy, planned.step, planned.before, problem.robot, planned.stage)
    return Stretch.of(planned, motion)
