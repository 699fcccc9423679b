"""Stored runs and motions, verified afresh."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from optiplan.errors import errors_about
from optiplan.planners.base import Failure
from optiplan.problem.from_python import NO_FILE
from optiplan.problem.load import problem_from_dict
from optiplan.problem.problem import Problem
from optiplan.runs.common_bound import duration_bound
from optiplan.runs.metrics import measure
from optiplan.runs.run import Run
from optiplan.runs.run_folder import RUN, StoredRun
from optiplan.trajectory.given_files import GivenFiles
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.bounds.duration_bound import DurationBound
from optiplan.verify.limit_checks import same_problem
from optiplan.verify.report import Check, Report
from optiplan.verify.verify import verify


def recorded_problem(record: Mapping[str, Any], file: Path | str) -> Problem:
    """Return the problem of a run.

    Args:
        record: content of `run.json`.
        file: its path, for messages.

    Raises:
        InputError: it cannot be read any more, as where the file of its robot is gone.
    """
    with errors_about(NO_FILE, str(file)):
        return problem_from_dict(record["problem"])


def run_of_record(
    record: Mapping[str, Any],
    motion: Trajectory | None,
    problem: Problem | None = None,
    given: GivenFiles | None = None,
    file: Path | str = RUN,
) -> Run:
    """A run from the content of its `run.json` and its motion, which is verified on the problem.

    Args:
        record: the content.
        motion: None where the planner failed.
        problem: None: as the record says, whose hash must be that of its problem.
        given: what stood in the files beside the motion, held against it.
        file: of the record, for messages.

    Raises:
        InputError: the problem of the record cannot be read any more.
    """
    own, problem = problem is None, recorded_problem(record, file) if problem is None else problem
    report = None if motion is None else verify(problem, motion, given=given)
    if report is not None and own and not (origin := same_problem(record, problem)).passed:
        report = _with_origin(report, origin)
    metrics = None if motion is None or report is None else measure(problem, motion, report)
    timings = dict(record.get("timings") or {})
    failed = record.get("failure")
    return Run(
        problem=problem.with_seed(int(record.get("seed", problem.seed))),
        planner=str(record.get("planner", problem.planner)),
        options=dict(record.get("options") or {}),
        trajectory=motion,
        failure=None if failed is None else Failure(failed["kind"], failed["detail"], failed.get("witness") or {}),
        report=report,
        lower_bound=None if motion is None or metrics is None else duration_bound(problem, motion),
        metrics=metrics,
        timings={key: value for key, value in timings.items() if key not in ("stages", "plan_cpu")},
        stages=timings.get("stages") or {},
        info=record.get("info") or {},
        improvements=tuple((float(when), float(best)) for when, best in record.get("improvements") or ()),
        plan_cpu=timings.get("plan_cpu"),
        proved_bound=DurationBound.from_dict(record["proved_bound"]) if record.get("proved_bound") else None,
    )


def judged(problem: Problem, stored: StoredRun) -> Report:
    """Verify a stored trajectory; the report names its origin and interpolation.

    Raises:
        ValueError: the run has no trajectory.
    """
    if stored.trajectory is None:
        raise ValueError("the run has no trajectory")
    report = verify(problem, stored.trajectory, given=stored.given)
    if stored.interpolation:
        report = replace(report, scope=(*report.scope, f"interpolation of the samples: {stored.interpolation}"))
    return _with_origin(report, same_problem(stored.record, problem)) if stored.record else report


def _with_origin(report: Report, origin: Check) -> Report:
    """Put first whether the run was made from its problem; constraints that no file holds say already that not."""
    said = any(check.name == origin.name for check in report.failures)
    return report if said else replace(report, checks=(origin, *report.checks))
