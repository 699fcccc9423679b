"""Which arm does which job, and in which order: schedules with the least makespan for durations that are given.

A job begins once its arm is free and the jobs before it are done; then its arm travels to it, and works. So a schedule
is known by its jobs in the order of their beginnings, each with its arm. Branch and bound goes through these orders; a
beam search gives it schedules to begin with.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from optiplan.arrays import Array
from optiplan.planners.base import Budget
from optiplan.records import dataclass

_BEAM = 100
"""Partial schedules that the beam search keeps."""

_SAME = 1e-9
"""s by which a schedule has to be shorter."""


@dataclass(frozen=True)
class ScheduledJob:
    """A job in a schedule: its number, that of its arm, and when it begins and ends, s."""

    job: int
    arm: int
    begin: float
    end: float


@dataclass(frozen=True)
class Schedule:
    """Jobs in the order of their beginnings."""

    jobs: tuple[ScheduledJob, ...]

    @property
    def makespan(self) -> float:
        """The end of the last job, s."""
        return max(one.end for one in self.jobs)

    def by(self, arm: int) -> "Schedule":
        """Return the schedule with all jobs done by this arm."""
        return Schedule(tuple(replace(one, arm=arm) for one in self.jobs))


@dataclass(frozen=True, eq=False)
class Durations:
    """How long jobs take.

    Attributes:
        work: (arms, jobs) s, without the way to the job; infinite where an arm cannot do it.
        travel: (arms, jobs + 1, jobs) s, from the end of each job to another; the last row is from the start.
        after: for each job the jobs that are done before it.
    """

    work: Array
    travel: Array
    after: tuple[tuple[int, ...], ...]

    @cached_property
    def least(self) -> Array:
        """The least time that each job takes, its way included (jobs,), s."""
        return np.asarray((self.work + self.travel.min(axis=1)).min(axis=0))

    @cached_property
    def tails(self) -> Array:
        """The least time from the beginning of each job to the end of all that follow it (jobs,), s."""
        tails = self.least.copy()
        for _ in range(len(tails)):
            for job, before in enumerate(self.after):
                for k in before:
                    tails[k] = max(tails[k], self.least[k] + tails[job])
        return tails

    @property
    def bound(self) -> float:
        """A lower bound, s, on the makespan: the longest chain of jobs, or the sum of least times over the arms."""
        return float(max(self.tails.max(), self.least.sum() / len(self.work)))

    def of_arm(self, arm: int) -> "Durations":
        """Return them with one arm alone."""
        return Durations(self.work[arm : arm + 1], self.travel[arm : arm + 1], self.after)


@dataclass(frozen=True)
class _Partial:
    """A schedule of some jobs; `free` when each arm is, and `last` its last job, -1 at the start."""

    jobs: tuple[ScheduledJob, ...]
    ends: dict[int, float]
    free: tuple[float, ...]
    last: tuple[int, ...]
    bound: float


class ScheduleSearch:
    """The best few schedules.

    Attributes:
        found: the best first, no more than `keep`.
        exact: whether no schedule is shorter than the first one, for these durations.
    """

    def __init__(self, durations: Durations, keep: int, budget: Budget) -> None:
        self.durations, self.keep = durations, keep
        self.found: list[Schedule] = []
        arms, _ = durations.work.shape
        start = _Partial((), {}, (0.0,) * arms, (-1,) * arms, durations.bound)
        self._list(start)
        self._beam(start)
        self.exact = self._branch(start, budget)

    def _list(self, state: _Partial) -> None:
        """Offer the schedule in which what can begin first begins, of that what takes longest with all that follows."""
        tails = self.durations.tails
        while children := list(self._children(state)):
            rows = [(one.jobs[-1].begin, one.jobs[-1].arm, -tails[one.jobs[-1].job]) for one in children]
            state = children[rows.index(min(rows))]
        if len(state.jobs) == len(tails):
            self._offer(state)

    def _beam(self, start: _Partial) -> None:
        level = [start]
        for _ in range(self.durations.work.shape[1]):
            grown = [child for parent in level for child in self._children(parent)]
            level = sorted(grown, key=lambda one: (one.bound, sum(one.free)))[:_BEAM]
        for one in level:
            self._offer(one)

    def _branch(self, start: _Partial, budget: Budget) -> bool:
        """Go through all orders that may be better than the worst one kept; return whether that was all of them."""
        open_, jobs, count = [start], self.durations.work.shape[1], 0
        while open_:
            count += 1
            if count % 100 == 0 and budget.over:
                return False
            state = open_.pop()
            if state.bound >= self._worst - _SAME:
                continue
            if len(state.jobs) == jobs:
                self._offer(state)
            else:
                open_ += sorted(self._children(state), key=lambda one: (-one.bound, -sum(one.free)))
        return True

    def _children(self, state: _Partial) -> Iterator[_Partial]:
        """Yield a schedule with each job and arm that can be next; beginnings do not fall.

        There is none where a job is left out for good: it and all others that are ready for its arms could only begin
        sooner than the last one, so these arms do nothing any more.
        """
        durations, arms = self.durations, range(len(state.free))
        since = (state.jobs[-1].begin, state.jobs[-1].arm) if state.jobs else (0.0, -1)
        left = [job for job in range(len(durations.after)) if job not in state.ends]
        ready = {
            job: max((state.ends[k] for k in durations.after[job]), default=0.0)
            for job in left
            if all(k in state.ends for k in durations.after[job])
        }
        able = {job: [arm for arm in arms if np.isfinite(durations.work[arm, job])] for job in left}
        going = {
            arm
            for job in left
            for arm in able[job]
            if job not in ready or (max(ready[job], state.free[arm]), arm) >= since
        }
        if not all(going.intersection(able[job]) for job in left):
            return
        for job in ready:
            for arm in able[job]:
                begin = max(ready[job], state.free[arm])
                end = begin + float(durations.travel[arm, state.last[arm], job] + durations.work[arm, job])
                if not np.isfinite(end) or (begin, arm) < since:
                    continue
                free = (*state.free[:arm], end, *state.free[arm + 1 :])
                last = (*state.last[:arm], job, *state.last[arm + 1 :])
                ends = {**state.ends, job: end}
                yield _Partial(
                    (*state.jobs, ScheduledJob(job, arm, begin, end)), ends, free, last, self._bound(ends, free)
                )

    def _bound(self, ends: dict[int, float], free: tuple[float, ...]) -> float:
        """Return a lower bound, s, on all schedules that begin like this."""
        left = [k for k in range(len(self.durations.after)) if k not in ends]
        bound = max((sum(free) + float(self.durations.least[left].sum())) / len(free), max(free))
        for k in left:
            before = [ends[i] for i in self.durations.after[k] if i in ends]
            soonest = min(free[a] for a in range(len(free)) if np.isfinite(self.durations.work[a, k]))
            bound = max(bound, max([soonest, *before]) + float(self.durations.tails[k]))
        return bound

    @property
    def _worst(self) -> float:
        return self.found[-1].makespan if len(self.found) >= self.keep else np.inf

    def _offer(self, state: _Partial) -> None:
        schedule = Schedule(state.jobs)
        if _who(schedule) not in {_who(one) for one in self.found}:
            self.found = sorted([*self.found, schedule], key=lambda one: one.makespan)[: self.keep]


def _who(schedule: Schedule) -> frozenset[tuple[int, tuple[int, ...]]]:
    """Return the jobs of each arm in their order."""
    arms: dict[int, Sequence[int]] = {}
    for one in schedule.jobs:
        arms[one.arm] = (*arms.get(one.arm, ()), one.job)
    return frozenset((arm, tuple(jobs)) for arm, jobs in arms.items())
