"""The one place where planning meets verification: `run` plans, has the answer verified, and keeps both as a `Run`."""

import platform
import resource
import time
import traceback
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import metadata
from typing import Any

import optiplan
from optiplan.errors import InputError, OptiPlanError
from optiplan.planners.base import Budget, Candidate, Failure, Progress
from optiplan.planners.common.via_legs import plan_through
from optiplan.planners.registry import make_planner
from optiplan.problem.problem import Problem
from optiplan.runs.metrics import Metrics, measure
from optiplan.runs.selection import best_verified
from optiplan.trajectory.timing.lower_bound import lower_bound
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.report import Report

LIBRARIES = ("numpy", "scipy", "pin", "coal", "ompl", "piqp", "qpsolvers", "toppra", "ruckig", "trimesh", "coacd")
"""Distributions whose version can change a result; recorded with every run."""

_PROVING, _MOST_PROVING = 0.05, 0.25
"""Share of the budget, and s at the most, that the planner leaves for the proof."""

SMALLEST_BOUND = 1e-4
"""s: a lower bound below it is rounding of one configuration, not a way from one to another."""


@dataclass(frozen=True, eq=False)
class Run:
    """What came of one problem and one planner.

    Attributes:
        planner: name in the registry.
        options: as the planner was given them, those left at their default not named.
        trajectory: None when the planner failed.
        failure: why there is no trajectory; None when there is one.
        report: the verdict on the trajectory; None when there is none.
        lower_bound: s; no motion from the start to the end that was reached is shorter. None without a trajectory.
            Whether that is a bound of the whole problem, `lower_bound_of` says.
        metrics: what the trajectory measures, verified or not; None without one that moves the robot's joints.
        timings: seconds of wall time: `plan`, `verify` and `measure`.
        stages: seconds of wall time of the planner's own stages.
        info: what the planner tells about its work, JSON-ready; `slowed`, the factor on the planner's duration that
            the verdict needed, if any.
        improvements: (seconds of planning and proving, duration in s) of every verified answer on the way.
        plan_cpu: seconds of processor time of planning alone, with that of processes that the planner waited for.
    """

    problem: Problem
    planner: str
    options: Mapping[str, Any]
    trajectory: Trajectory | None
    failure: Failure | None
    report: Report | None
    lower_bound: float | None
    metrics: Metrics | None
    timings: Mapping[str, float]
    stages: Mapping[str, float]
    info: Mapping[str, Any] = field(default_factory=dict)
    improvements: tuple[tuple[float, float], ...] = ()
    plan_cpu: float | None = None

    @property
    def verified(self) -> bool:
        """Whether there is a trajectory and its report says so; nothing else makes a run verified."""
        return self.report is not None and self.report.verified

    @property
    def duration(self) -> float | None:
        """Length of the motion in time, s."""
        return None if self.trajectory is None else self.trajectory.duration

    @property
    def lower_bound_of(self) -> str:
        """`problem`, if all its motions end in one configuration, so that none is shorter than the bound; else `end`.

        A motion to another end of the same goal may be shorter than the bound of this end.
        """
        return "problem" if self.problem.one_end else "end"

    @property
    def ratio(self) -> float | None:
        """Duration / lower_bound, at least 1; None without a trajectory or when the robot need not move."""
        return share_of(self.duration, self.lower_bound)

    def to_dict(self) -> dict[str, Any]:
        """What `run.json` holds: everything but the motion itself, JSON-ready up to numpy numbers."""
        failure = self.failure
        return {
            "name": self.problem.name,
            "hash": self.problem.hash,
            "problem": dict(self.problem.source),
            "planner": self.planner,
            "options": dict(self.options),
            "seed": self.problem.seed,
            "verified": self.verified,
            "duration": self.duration,
            "lower_bound": self.lower_bound,
            "lower_bound_of": None if self.lower_bound is None else self.lower_bound_of,
            "ratio": self.ratio,
            "metrics": self.metrics and self.metrics.to_dict(),
            "failure": failure and {"kind": failure.kind, "detail": failure.detail, "witness": dict(failure.witness)},
            "report": self.report and self.report.to_dict(),
            "timings": {**self.timings, "plan_cpu": self.plan_cpu, "stages": dict(self.stages)},
            "geometry": dict(self.problem.robot.link_geometry),
            "over_cover": dict(self.problem.robot.over_cover),
            "notes": list(self.problem.robot.notes),
            "info": dict(self.info),
            "improvements": [list(improvement) for improvement in self.improvements],
            "versions": versions(),
        }


def share_of(duration: float | None, bound: float | None) -> float | None:
    """Duration / bound; None without either or when the robot need not move."""
    return None if duration is None or not bound or bound < SMALLEST_BOUND else duration / bound


def run(problem: Problem, planner: str, options: Mapping[str, Any], budget: Budget, progress: Progress) -> Run:
    """Plan, verify and measure; planning and proving are held to the budget.

    The answer is the best of the planner's candidates that is verified, slowed down a little where only that helps.

    Args:
        problem: its own `planner` and `options` are not looked at.
        planner: name in the registry.
        options: of that planner.
        budget: counted from the planner's start; loading its libraries is not part of it.
        progress: told the planner's stages, then `verify`.

    Raises:
        UnknownChoiceError: there is no such planner, or it has no such option.
        InputError: an option has a value that it cannot have.
    """
    chosen = make_planner(planner, options)
    budget.start()
    began, spent = time.perf_counter(), processor_time()
    result = plan_through(chosen, problem, budget.leaving(reserve(budget.seconds)), progress)
    timings, spent = {"plan": time.perf_counter() - began}, processor_time() - spent
    selection = bound = metrics = None
    if result.trajectory is not None:
        progress("verify", 0.0)
        seconds = timings["plan"] if result.seconds is None else result.seconds
        began = time.perf_counter()
        selection = best_verified(problem, [*result.earlier, Candidate(result.trajectory, seconds)], budget)
        timings["verify"] = time.perf_counter() - began
        bound = lower_bound(problem.start, selection.trajectory.end, problem.limits)
        began = time.perf_counter()
        metrics = measure(problem, selection.trajectory, selection.report)
        timings["measure"] = time.perf_counter() - began
    slowed = {"slowed": selection.slowed} if selection is not None and selection.slowed > 1.0 else {}
    return Run(
        problem=problem,
        planner=planner,
        options=dict(options),
        trajectory=None if selection is None else selection.trajectory,
        failure=result.failure,
        report=None if selection is None else selection.report,
        lower_bound=bound,
        metrics=metrics,
        timings=timings,
        stages=dict(result.timings),
        info={**result.info, **slowed},
        improvements=() if selection is None else selection.improvements,
        plan_cpu=spent,
    )


def attempt(problem: Problem, planner: str, options: Mapping[str, Any], budget: Budget, progress: Progress) -> Run:
    """`run` as one of several: what the planner raises is its failure and does not end the comparison.

    Failure kinds besides those of planners: `input`, it cannot do this problem with these options (witness: `issues`);
    `bug`, it raised what it must not (witness: `traceback`).
    """
    began = time.perf_counter()
    try:
        return run(problem, planner, options, budget, progress)
    except OptiPlanError as error:
        issues = [vars(issue) for issue in error.issues] if isinstance(error, InputError) else []
        failure = Failure("input", str(error), {"issues": issues})
    except Exception as error:
        failure = Failure("bug", f"{type(error).__name__}: {error}", {"traceback": traceback.format_exc()})
    return Run(
        problem=problem,
        planner=planner,
        options=dict(options),
        trajectory=None,
        failure=failure,
        report=None,
        lower_bound=None,
        metrics=None,
        timings={"plan": time.perf_counter() - began},
        stages={},
    )


def reserve(seconds: float) -> float:
    """Seconds of a budget that the planner leaves for the proof."""
    return min(_PROVING * seconds, _MOST_PROVING)


def processor_time() -> float:
    """Seconds of processor time of this process and of the processes that it started and waited for."""
    waited = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + waited.ru_utime + waited.ru_stime


def versions() -> dict[str, str]:
    """Versions of OptiPlan, Python and the libraries that can change a result."""
    found = {"optiplan": optiplan.__version__, "python": platform.python_version()}
    for name in LIBRARIES:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:  # installed by other means than pip
            found[name] = "unknown"
    return found
