"""`assign`: which arm does which job of an assembly, and in which order."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from optiplan.api.checking import planner_issues
from optiplan.api.planning import plan_within, positive_seconds
from optiplan.errors import InputError, described, progress_argument, wrong_argument
from optiplan.planners.base import Budget, Progress, silent
from optiplan.runs.run_folder import folder_argument
from optiplan.studies.assembly.measuring import Measured, measure_jobs
from optiplan.studies.assembly.result import Assignment, Planned, job_times
from optiplan.studies.assembly.schedule import Schedule, ScheduleSearch
from optiplan.studies.assembly.statement import Assembly, read_assembly

BUDGET = 120.0
"""Seconds for all of it, when none are given."""

_ALONE, _ORDERS = 0.5, 0.1
"""Shares of the budget for the jobs alone, and of what is left then for the search of schedules."""

_KEPT, _LONGER = 4, 1.1
"""Schedules that are planned whole, unless they are longer than a verified motion by this factor.

Durations are of jobs alone: a motion is longer where arms wait for each other, and shorter where it need not stop.
"""


def assign(
    source: Path | str | Mapping[str, Any],
    *,
    out: Path | str | None = None,
    budget: float = BUDGET,
    progress: Progress | None = None,
) -> Assignment:
    """Give the jobs of an assembly to arms, so that the last one is done soonest, proved.

    Each job is planned alone by each arm that may do it. Branch and bound finds the schedules that are shortest by
    these durations. The best few are planned whole and verified, and so is the best of one arm alone; the shortest
    verified motion is the answer. Ctrl-C ends the search, and what was verified so far is the result.

    Args:
        source: an assembly file, or its content; docs/how-to/assemblies.md has the keys.
        out: folder for `problem.yaml`, as it is given to arms, and the run folder `run`; None: nothing is written.
        budget: s, half of it at most for the jobs alone.
        progress: called with the stage and its fraction.

    Returns:
        The assignment: `jobs` (which arm does which and when), `makespan`, `run`, `one_arm`, `bound`, `impossible`.

    Raises:
        InputError: with every issue of the file; an argument that does not fit.

    Example:
        >>> import optiplan as op
        >>> arms = {"a": {"use": "planar2r"}, "b": {"use": "planar2r", "base": {"position": [0, 3, 0]}}}
        >>> jobs = [{"name": name, "steps": [{"move": {"joints": [1.0, 0.5]}}]} for name in ("one", "two")]
        >>> found = op.assign({"version": 1, "robots": arms, "start": {"configuration": "ready"}, "jobs": jobs})
        >>> sorted(one.arm for one in found.jobs)
        ['a', 'b']
    """
    progress_argument("assign", progress)
    if not isinstance(source, Path | str | Mapping):
        expected = "the path of an assembly file, or a mapping of its keys"
        raise wrong_argument("assign", "source", described(source), expected)
    seconds = positive_seconds("assign", budget)
    folder = folder_argument("assign", out)
    if not isinstance(source, Mapping) and (wrong := planner_issues(Path(source))):
        raise InputError(wrong)
    found = _AssignmentSearch(read_assembly(source), Budget(seconds), progress or silent).result()
    if folder is not None:
        found.save(folder)
    return found


class _AssignmentSearch:
    """The search for an assignment, which keeps what it has when it is interrupted."""

    def __init__(self, assembly: Assembly, budget: Budget, progress: Progress) -> None:
        self.assembly, self.budget, self.progress = assembly, budget, progress
        self.measured: Measured | None = None
        self.planned: list[Planned] = []
        self.one_arm: Planned | None = None
        self.exact = False
        self.refused: list[str] = []

    def result(self) -> Assignment:
        """Search until all is done, the budget is spent, or Ctrl-C."""
        try:
            ended = "done" if self._run() else "budget"
        except KeyboardInterrupt:
            ended = "interrupted"
        refused = tuple(dict.fromkeys(self.refused))
        return Assignment(self.assembly, self.measured, tuple(self.planned), self.one_arm, self.exact, ended, refused)

    def _run(self) -> bool:
        """Return whether all was done."""
        self.measured = measure_jobs(self.assembly, plan_within, self.budget.share(_ALONE), self.progress)
        self.progress("schedules", 0.0)
        durations = self.measured.durations
        if not _all_can(durations.work.min(axis=0)):
            return not self.budget.over
        search = ScheduleSearch(durations, _KEPT, self.budget.share(_ORDERS))
        self.exact = search.exact
        single = self._of_one_arm(self.measured)
        for k, schedule in enumerate(search.found):
            best = min((one.makespan for one in self.planned), default=float("inf"))
            if schedule.makespan < _LONGER * best:
                self.progress("planning the best schedules", k / (len(search.found) + 1))
                if self.budget.over:
                    return False
                self._plan(schedule, 1.0 / (len(search.found) - k + (self.one_arm is None)))
            if k == 0 and single is not None:
                self.one_arm = self._whole(single, 1.0 / len(search.found))
        return search.exact and not self.budget.over

    def _of_one_arm(self, measured: Measured) -> Schedule | None:
        """Return the best schedule of one arm alone; None where no arm can do all jobs."""
        found = []
        for a in range(len(measured.arms)):
            durations = measured.durations.of_arm(a)
            if _all_can(durations.work[0]):
                best = ScheduleSearch(durations, 1, self.budget.share(_ORDERS)).found[0]
                found.append(best.by(a))
        return min(found, key=lambda one: one.makespan, default=None)

    def _plan(self, schedule: Schedule, share: float) -> None:
        planned = self._whole(schedule, share)
        if planned is not None:
            self.planned.append(planned)

    def _whole(self, schedule: Schedule, share: float) -> Planned | None:
        """Plan a schedule; None where it makes no problem, such as a job that takes what another arm still holds."""
        assert self.measured is not None, "schedules are made of what was measured"
        arms = self.measured.arms
        try:
            problem, steps = self.assembly.whole([(one.job, arms[one.arm]) for one in schedule.jobs])
        except InputError as error:
            self.refused += [str(issue) for issue in error.issues]
            return None
        run = plan_within(problem, self.budget.share(share))
        return Planned(schedule, run, job_times(self.assembly, schedule, arms, steps, run))


def _all_can(work: Any) -> bool:
    return all(float(value) < float("inf") for value in work)
