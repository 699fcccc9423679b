"""Arms beside each other: steps that were planned one after another begin as early as nothing meets.

The steps are planned one after another, in an order in which each arm does as much as it can at a time. Then the parts
between two stops are put into time in that order. A part keeps its motion, and begins once the one before it and the
steps for which it waits have ended, or later: as soon as it, and waiting after it, are free of all that is there by
then. When the other arms rest it is as free as it was planned, so there is always such a time.
"""

from collections.abc import Iterator, Sequence
from dataclasses import field, replace
from itertools import groupby, pairwise

import numpy as np

from optiplan.arrays import Array
from optiplan.collision.model import CollisionModel
from optiplan.collision.native_model import NativeCollisionModel, planning_model
from optiplan.geometry.scene import Scene
from optiplan.planners.base import Budget
from optiplan.planners.common.continuous_collision import first_contact
from optiplan.planners.task.planned_steps import PlannedStep, Stretch, TaskPart, object_and_link
from optiplan.planners.task.via_moves import ViaMoves
from optiplan.problem.problem import Problem, derived
from optiplan.problem.task.arms import in_time_order, joints_of_arms, of_one_arm, several_arms, steps_of_arms
from optiplan.problem.task.scene_change import scene_after
from optiplan.problem.task.steps import Attach, Detach, TaskStep
from optiplan.problem.task.timeline import MEETING, states_its_end
from optiplan.records import dataclass
from optiplan.trajectory.joining import (
    beside_each_other,
    cut_trajectory,
    join_trajectories,
    standstill,
    with_resting_joints,
)
from optiplan.trajectory.segments import Segment
from optiplan.trajectory.trajectory import Trajectory

_DELAY = 0.1
"""s by which a part that is not free begins later."""


def one_after_another(problem: Problem) -> Problem:
    """Return the problem with the steps of each arm in a row, up to where it waits; itself without arms."""
    if not several_arms(problem.task):
        return problem
    left = {arm: list(places) for arm, places in steps_of_arms(problem.task).items()}
    numbers = [step.number for step in problem.task]
    order: list[int] = []
    while any(left.values()):
        for places in left.values():
            while places and not _blocked(problem.task[places[0]], numbers, order):
                order.append(places.pop(0))
    return derived(problem, task=tuple(problem.task[k] for k in order))


def _blocked(step: TaskStep, numbers: Sequence[int], done: Sequence[int]) -> bool:
    """Whether a step for which one waits has a part that is not done."""
    return any(numbers[k] in step.waits for k in range(len(numbers)) if k not in done)


def quickest_beside(moves: ViaMoves, parts: Sequence[TaskPart], in_a_row: Trajectory, budget: Budget) -> Trajectory:
    """Return the motion of parts, each as early as it is free, with its segments in the order of their times.

    Args:
        moves: with the problem whose steps the parts are, in a row.
        parts: of each arm, from rest to rest; none: they stay in a row.
        in_a_row: their motion one after another, which is the answer when time is over.
        budget: time for it.
    """
    timed = _Timetable(moves.problem, budget).of(parts) if parts else None
    if timed is None:
        return replace(in_a_row, segments=in_time_order(moves.problem.task, in_a_row.segments))
    motion, segments = timed
    whole = moves.motion(replace(motion, segments=segments))
    return replace(whole, segments=in_time_order(moves.problem.task, whole.segments))


@dataclass(frozen=True, eq=False)
class _Timed:
    """A part that begins at a time, s."""

    begin: float
    part: TaskPart

    @property
    def end(self) -> float:
        return self.begin + self.part.ends[-1]


@dataclass(frozen=True, eq=False)
class _Change:
    """Times, s, from which and up to which a step is done; an event at both."""

    planned: PlannedStep
    begin: float
    end: float


@dataclass(eq=False)
class _Timetable:
    """Parts of all arms in time.

    Attributes:
        problem: with the steps in a row.
        budget: time for all.
        done: of each arm the parts that have their time.
        ends: when each step ends, s, by its number.
        steps: all steps that have their time.
    """

    problem: Problem
    budget: Budget
    done: dict[str, list[_Timed]] = field(default_factory=dict)
    ends: dict[int, float] = field(default_factory=dict)
    steps: list[_Change] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.columns = joints_of_arms(self.problem.task, self.problem.robot.joint_names)
        self.done = {arm: [] for arm in self.columns}
        self._whole: dict[str, Trajectory] = {}
        self._models: dict[tuple[object, ...], CollisionModel] = {}
        self._scenes: dict[tuple[int, ...], Scene] = {}

    def of(self, parts: Sequence[TaskPart]) -> tuple[Trajectory, tuple[Segment, ...]] | None:
        """Return the motion with its segments in the order of the parts; None when time is over."""
        self.horizon = sum(part.ends[-1] for part in parts) + 1.0
        timed: list[_Timed] = []
        for arm, run in groupby(parts, key=lambda part: part.steps[0].step.arm):
            found = self._run(arm, list(run))
            if found is None:
                return None
            timed += found
        motion = self._motion(0.0, max(one.end for one in timed))
        return motion, tuple(segment for one in timed for segment in _segments(one))

    def _run(self, arm: str, parts: list[TaskPart]) -> list[_Timed] | None:
        """Give parts of one arm that follow each other their times; None when time is over, or none is free."""
        rest = max((other.end for own in self.done.values() for other in own), default=0.0)
        begin = self.done[arm][-1].end if self.done[arm] else 0.0
        known, tried = list(self.steps), set[tuple[int, int]]()
        own: list[_Timed] = []
        times = [self._times(arm, parts, 0, begin, rest, known)]
        while times:
            if self.budget.over:
                return None
            k = len(times) - 1
            del own[k:]
            known = [*self.steps, *(change for one in own for change in _changes(one))]
            start = next(times[k], None)
            key = (k, round(1e3 * start)) if start is not None else (k, -1)
            if start is None or key in tried:
                if start is None:
                    times.pop()
                continue
            tried.add(key)
            own.append(_Timed(start, parts[k]))
            if k + 1 < len(parts):
                known = [*known, *_changes(own[-1])]
                times.append(self._times(arm, parts, k + 1, own[-1].end, rest, known))
            elif self._free(arm, None, parts[k].steps[-1].after.q, (own[-1].end, rest), [*known, *_changes(own[-1])]):
                self.done[arm] += own
                self._whole.pop(arm, None)
                self.steps += [change for one in own for change in _changes(one)]
                self.ends |= {change.planned.step.number: change.end for one in own for change in _changes(one)}
                return own
        return None

    def _times(
        self,
        arm: str,
        parts: Sequence[TaskPart],
        k: int,
        since: float,
        rest: float,
        known: list[_Change],
    ) -> Iterator[float]:
        """Yield times at which part k may begin: until then the arm waits where it is, and all is free."""
        part = parts[k]
        ends = {**self.ends, **{change.planned.step.number: change.end for change in known}}
        start = max([since, *(ends[number] for number in part.steps[0].step.waits)])
        waited = since
        while True:
            if start > waited and not self._free(arm, None, part.steps[0].before.q, (waited, start), known):
                return
            waited = start
            if self._free(arm, part, part.steps[0].before.q, (start, start + part.ends[-1]), known):
                yield start
            if start >= rest:
                return
            start = min(start + _DELAY, rest)

    def _free(
        self,
        arm: str,
        part: TaskPart | None,
        q: Array,
        between: tuple[float, float],
        known: list[_Change],
    ) -> bool:
        """Whether an arm may do a part, or wait at q (n,), between two times, s, beside what others do."""
        begin, end = between
        if not end > begin:
            return True
        own = [] if part is None else [_Timed(begin, part)]
        motion = self._motion(begin, end, (arm, self._of_arm(self.columns[arm], q, own, begin, end)))
        changes = [*known, *(change for one in own for change in _changes(one))]
        times = sorted({begin, end, *(t for c in changes for t in (c.begin, c.end) if begin < t < end)})
        pieces: list[tuple[float, float, tuple[object, ...], CollisionModel]] = []
        for low, high in pairwise(times):
            key, model = self._model(changes, low, high)
            if pieces and pieces[-1][2] == key:
                low = pieces.pop()[0]
            pieces.append((low, high, key, model))
        for low, high, _, model in pieces:
            moved = cut_trajectory(motion, low - begin, min(high - begin, motion.duration))
            if first_contact(model, moved, lambda: self.budget.over) is not None:
                return False
        return True

    def _model(self, changes: Sequence[_Change], low: float, high: float) -> tuple[tuple[object, ...], CollisionModel]:
        """Return the model of what is there, and may touch, between two times between which nothing changes."""
        scene, numbers = self.problem.scene, []
        events = [c for c in changes if isinstance(c.planned.step.action, Attach | Detach) and c.begin <= low]
        for change in sorted(events, key=lambda c: (c.begin, c.planned.step.number)):
            numbers.append(change.planned.step.number)
            known = self._scenes.get(tuple(numbers))
            if known is None:
                action = change.planned.step.action
                assert isinstance(action, Attach | Detach)
                known = scene_after(scene, action, self.problem.robot, change.planned.before.q)
                self._scenes[tuple(numbers)] = known
            scene = known
        active = [c.planned.step.allowed for c in changes if c.begin < high and c.end > low]
        allowed = frozenset[frozenset[str]]().union(scene.allowed, *active)
        key: tuple[object, ...] = (tuple(numbers), allowed)
        if key not in self._models:
            own = replace(scene, allowed=allowed)
            self._models[key] = planning_model(self.problem.robot, own, error=self.problem.tracking_error)
        model = self._models[key]
        if not isinstance(model, NativeCollisionModel) or model.floors is None:
            return key, model
        times = [c.begin for c in changes if isinstance(c.planned.step.action, Attach | Detach)]
        since = max((t for t in times if t <= low), default=0.0)
        ended = self._ended(changes, since, min((t for t in times if t >= high), default=np.inf))
        key = (*key, since == 0.0, tuple(ended))
        if key not in self._models:
            ends = ([self.problem.start] if since == 0.0 else []) + list(ended.values())
            self._models[key] = model.about_ends(*ends)
        return key, self._models[key]

    def _ended(self, changes: Sequence[_Change], since: float, until: float) -> dict[int, Array]:
        """Return where the arms are, (n,), at the ends of steps between two times, s, by the numbers of the steps.

        Pairs that one arm moves may be nearer there than required, whatever the others do: they are nan.
        """
        found = {}
        for change in changes:
            step = change.planned.step
            if states_its_end(step.action) and since - MEETING <= change.end <= until + MEETING:
                found[step.number] = of_one_arm(step.arm, self.columns, change.planned.after.q)
        return dict(sorted(found.items()))

    def _motion(self, begin: float, end: float, other: tuple[str, Trajectory] | None = None) -> Trajectory:
        """Return the motion of all joints between two times, s; that of one arm may be another than it has so far."""
        names, start = self.problem.robot.joint_names, self.problem.start
        moved = [column for own in self.columns.values() for column in own]
        still = [k for k in range(len(names)) if k not in moved]
        motions = [(still, self._standing(still, start, end - begin))] if still else []
        for arm, columns in self.columns.items():
            if other is not None and arm == other[0]:
                motions.append((columns, other[1]))
                continue
            if arm not in self._whole:
                self._whole[arm] = self._of_arm(columns, start, self.done[arm], 0.0, self.horizon)
            motions.append((columns, _until(cut_trajectory(self._whole[arm], begin, end), end - begin)))
        return beside_each_other(motions, names)

    def _standing(self, columns: Sequence[int], q: Array, seconds: float) -> Trajectory:
        names = tuple(self.problem.robot.joint_names[k] for k in columns)
        return standstill(names, np.asarray(q)[list(columns)], seconds)

    def _of_arm(self, columns: Sequence[int], q: Array, own: Sequence[_Timed], begin: float, end: float) -> Trajectory:
        """Return the motion of an arm's joints between two times, s, from q (n,) before its first part on."""
        pieces: list[Trajectory] = []
        now = begin
        for one in own:
            if one.end <= begin:
                q = one.part.steps[-1].after.q
                continue
            if one.begin >= end:
                break
            if one.begin > now:
                pieces.append(self._standing(columns, q, one.begin - now))
            low, high = max(one.begin, begin), min(one.end, end)
            if high > low:
                whole = self._part(columns, one.part)
                inside = low - one.begin, min(high - one.begin, whole.duration)
                pieces.append(whole if inside == (0.0, whole.duration) else cut_trajectory(whole, *inside))
                now = high
            q = one.part.steps[-1].after.q
        if end > now:
            pieces.append(self._standing(columns, q, end - now))
        return _until(join_trajectories(pieces), end - begin)

    def _part(self, columns: Sequence[int], part: TaskPart) -> Trajectory:
        """Return the motion of an arm's joints in a part."""
        q = part.steps[0].before.q
        still = self._standing(columns, q, part.ends[-1])
        if not isinstance(part, Stretch):
            return still
        moving = [list(columns).index(column) for column in part.steps[0].stage.columns]
        return with_resting_joints(part.motion, moving, still.joint_names, np.asarray(q)[list(columns)])


def _until(motion: Trajectory, end: float) -> Trajectory:
    """Return a motion that ends at a time, s, which is a rounding off: all arms end together."""
    breakpoints = motion.breakpoints.copy()
    breakpoints[-1] = end
    return replace(motion, breakpoints=breakpoints)


def _changes(one: _Timed) -> list[_Change]:
    """Return the steps of a part in time."""
    begins = [one.begin, *(one.begin + end for end in one.part.ends[:-1])]
    return [
        _Change(planned, begin, one.begin + end)
        for planned, begin, end in zip(one.part.steps, begins, one.part.ends, strict=True)
    ]


def _segments(one: _Timed) -> Iterator[Segment]:
    for change in _changes(one):
        step = change.planned.step
        yield Segment(step.number, step.kind, step.name, change.begin, change.end, *object_and_link(change.planned))
