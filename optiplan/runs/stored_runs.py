"""Stored runs and motions, verified afresh."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from optiplan.planners.base import Failure
from optiplan.problem.load import problem_from_dict
from optiplan.problem.problem import Problem
from optiplan.runs.common_bound import duration_bound
from optiplan.runs.metrics import measure
from optiplan.runs.run import Run
from optiplan.runs.run_folder import StoredRun
from optiplan.trajectory.given_files import GivenFiles
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.bounds.duration_bound import DurationBound
from optiplan.verify.limit_checks import same_problem
from optiplan.verify.report import Report
from optiplan.verify.verify import verify


def run_of_record(
    record: Mapping[str, Any],
    motion: Trajectory | None,
    problem: Problem | None = None,
    given: GivenFiles | None = None,
) -> Run:
    """A run from the content of its `run.json` and its motion, which is verified on the problem.

    Args:
        record: the content.
        motion: None where the planner failed.
        problem: None: as the record says.
        given: what stood in the files beside the motion, held against it.

    Raises:
        InputError: the problem of the record cannot be read any more.
    """
    if problem is None:
        problem = problem_from_dict(record["problem"])
    report = None if motion is None else verify(problem, motion, given=given)
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
    if "hash" in stored.record:
        report = replace(report, checks=(same_problem(stored.record, problem), *report.checks))
    return report
