"""What came of an assembly: the best verified motion, which arm does which job when, and what it is beside."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from optiplan.records import dataclass
from optiplan.runs.run import Run
from optiplan.studies.assembly.measuring import Measured
from optiplan.studies.assembly.schedule import Schedule
from optiplan.studies.assembly.statement import Assembly


@dataclass(frozen=True)
class JobTime:
    """A job in a motion: `begin` and `end` in s, its way included."""

    job: str
    arm: str
    begin: float
    end: float


@dataclass(frozen=True, eq=False)
class Planned:
    """A schedule that was planned whole: its run, and the times of its jobs where that is verified."""

    schedule: Schedule
    run: Run
    jobs: tuple[JobTime, ...]

    @property
    def verified(self) -> bool:
        """Whether the motion is proved, and does every job after those before it."""
        return self.run.verified and bool(self.jobs)

    @property
    def makespan(self) -> float:
        """The duration, s; infinite without a verified motion."""
        return float(self.run.duration or 0.0) if self.verified else float("inf")


@dataclass(frozen=True, eq=False, repr=False)
class Assignment:
    """Jobs of an assembly, given to arms.

    Attributes:
        measured: how long each arm takes for each job alone, and which it cannot do; None: interrupted before.
        planned: schedules that were planned whole, in that order.
        one_arm: the best schedule of one arm alone, planned; None: no arm can do all jobs, or it was not planned.
        exact: whether no schedule is shorter than the first one, for the durations measured.
        ended: `done`, `budget` or `interrupted`.
        refused: why schedules made no problem, such as a job that takes what another arm still holds.
    """

    assembly: Assembly
    measured: Measured | None
    planned: tuple[Planned, ...]
    one_arm: Planned | None
    exact: bool
    ended: str
    refused: tuple[str, ...] = ()

    @property
    def best(self) -> Planned | None:
        """The verified motion with the least makespan; None without one."""
        known = [one for one in (*self.planned, self.one_arm) if one is not None and one.verified]
        return min(known, key=lambda one: one.makespan, default=None)

    @property
    def run(self) -> Run | None:
        """The run of `best`."""
        return None if self.best is None else self.best.run

    @property
    def jobs(self) -> tuple[JobTime, ...]:
        """Which arm does which job and when, in the order of their beginnings; empty without a verified motion."""
        return () if self.best is None else self.best.jobs

    @property
    def makespan(self) -> float | None:
        """The duration of the best verified motion, s."""
        return None if self.best is None else self.best.makespan

    @property
    def bound(self) -> float | None:
        """The longest chain of jobs, or their sum over the arms, s, by the durations measured; None: a job has none.

        No schedule of these durations is shorter. A motion may be, where it works on without the stops of the jobs.
        """
        return None if self.measured is None or self.impossible else self.measured.durations.bound

    @property
    def impossible(self) -> dict[str, Mapping[str, str]]:
        """The jobs that no arm was found to do, with the reason of each arm."""
        if self.measured is None:
            return {}
        return {
            job.name: {arm: self.measured.unable[arm, job.number] for arm in job.arms}
            for job in self.assembly.jobs
            if not any((arm, job.number) in self.measured.alone for arm in job.arms)
        }

    @property
    def words(self) -> str:
        """The result in sentences."""
        if self.impossible:
            reasons = (
                f"{job} ({'; '.join(f'{arm}: {why}' for arm, why in arms.items())})"
                for job, arms in self.impossible.items()
            )
            return f"no arm was found to do: {', '.join(reasons)}"
        if self.best is None:
            why = ", since it was interrupted" if self.ended == "interrupted" else ""
            return f"no schedule was verified{why}" + "".join(f"; one makes no problem: {one}" for one in self.refused)
        alone = self.one_arm
        if alone is None:
            beside = "no arm alone was planned" if self._one_can else "no arm can do all jobs alone"
        elif not alone.verified:
            beside = "with one arm alone: no verified motion"
        else:
            beside = f"with one arm alone: {alone.makespan:.3f} s"
        least = "no schedule is shorter" if self.exact else "not all schedules were looked at"
        bound = f"lower bound of the durations measured: {self.bound:.3f} s; {least} by these"
        return f"makespan {self.best.makespan:.3f} s, verified; {beside}; {bound}"

    @property
    def _one_can(self) -> bool:
        jobs = self.assembly.jobs
        found = self.measured
        return found is not None and any(all((arm, job.number) in found.alone for job in jobs) for arm in found.arms)

    @property
    def data(self) -> dict[str, Any]:
        """JSON-ready; s."""
        alone = self.one_arm
        return {
            "jobs": [vars(one) for one in self.jobs],
            "makespan": self.makespan,
            "one_arm": alone.makespan if alone is not None and alone.verified else None,
            "lower_bound": self.bound,
            "exact": self.exact,
            "ended": self.ended,
            "impossible": self.impossible,
            "refused": list(self.refused),
            "unable": [] if self.measured is None else self._unable,
            "planned": [
                {
                    "estimate": one.schedule.makespan,
                    "makespan": one.run.duration if one.verified else None,
                    "verified": one.verified,
                }
                for one in self.planned
            ],
        }

    @property
    def _unable(self) -> list[dict[str, str]]:
        assert self.measured is not None, "asked for where jobs were measured"
        jobs = self.assembly.jobs
        return [{"job": jobs[k].name, "arm": arm, "reason": why} for (arm, k), why in self.measured.unable.items()]

    def save(self, folder: Path) -> list[Path]:
        """Write `problem.yaml`, the problem as it is given to arms, and the run folder `run`; return the paths.

        Without a verified motion nothing is written.
        """
        if self.run is None:
            return []
        paths = [folder / "problem.yaml", folder / "run"]
        folder.mkdir(parents=True, exist_ok=True)
        self.run.problem.save(paths[0])
        self.run.save(paths[1])
        return paths

    def __repr__(self) -> str:
        """Return the result in a line."""
        return f"Assignment: {self.words}"


def job_times(
    assembly: Assembly, schedule: Schedule, arms: tuple[str, ...], steps: Mapping[int, range], run: Run
) -> tuple[JobTime, ...]:
    """Return the times of the jobs in a verified motion; none where one begins before those that it comes after end."""
    if not run.verified or run.trajectory is None:
        return ()
    found: dict[int, JobTime] = {}
    for one in schedule.jobs:
        own = [part for part in run.trajectory.segments if part.step in steps[one.job]]
        begin, end = min(part.begin for part in own), max(part.end for part in own)
        found[one.job] = JobTime(assembly.jobs[one.job].name, arms[one.arm], begin, end)
    early = [k for k, one in found.items() for j in assembly.jobs[k].after if one.begin < found[j].end]
    return () if early else tuple(sorted(found.values(), key=lambda one: (one.begin, one.end)))
