"""Verdict on a stored motion of any origin."""

from dataclasses import replace

from optiplan.problem.problem import Problem
from optiplan.runs.run_folder import StoredRun
from optiplan.verify.limit_checks import same_problem
from optiplan.verify.report import Report
from optiplan.verify.verify import verify


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
