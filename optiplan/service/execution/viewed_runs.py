"""Runs as the viewer shows them, from the texts of their files: their names, and what of their verdicts still holds."""

import json
from collections.abc import Mapping, Sequence
from typing import Any

from optiplan.errors import OptiPlanError
from optiplan.problem.problem import Problem
from optiplan.service.execution.problem_reader import files_changed
from optiplan.trajectory.trajectory import Trajectory
from optiplan.viewer.runs import ViewedRun, distinct_labels

NOW = "files of the problem, or this program, were changed since: for the scene of now the run was not verified"


def viewed_runs(
    problem: Problem, runs: Sequence[Mapping[str, str]], ids: Sequence[str], labels: Sequence[str]
) -> list[ViewedRun]:
    """Return runs of a problem to show.

    Args:
        problem: as its files are now.
        runs: the texts of `run` (run.json) and `trajectory`, empty without.
        ids: of the runs.
        labels: of the runs; empty: the names of their planners.

    Raises:
        OptiPlanError: the robot has other joints now than a motion.
    """
    records = [json.loads(one["run"]) for one in runs]
    given = list(labels) or [str(record.get("planner", "run")) for record in records]
    seeds, short = [f"seed {record.get('seed')}" for record in records], [run[:8] for run in ids]
    names = distinct_labels(given, seeds, short)
    return [_viewed(problem, *one) for one in zip(names, records, [one["trajectory"] for one in runs], strict=True)]


def _viewed(problem: Problem, label: str, record: Mapping[str, Any], text: str) -> ViewedRun:
    """Return a run; where files of its problem were changed since, without what was proved and measured then."""
    motion = Trajectory.from_dict(json.loads(text)) if text else None
    if not files_changed(record, problem):
        return ViewedRun(label, motion, record.get("report"), record.get("failure"), record)
    if motion is not None and motion.joint_names != problem.robot.joint_names:
        raise OptiPlanError("files of the problem were changed since: its robot has other joints now than the motion")
    failed = record.get("failure") or {"kind": "not checked"}
    detail = "; ".join(filter(None, (failed.get("detail"), NOW)))
    return ViewedRun(label, motion, None, {"kind": failed["kind"], "detail": detail}, {**record, "metrics": None})
