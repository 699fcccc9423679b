"""Results in the terms of robometrics' `TrajectoryMetrics`, which cuRobo's benchmarks use too: written and read.

The file is JSON, `{set: [metrics, …]}`, problems in their order. Of its fields we have, with their units there:
`success`, `skip` (no trajectory), `motion_time` and `solve_time` (s), `eef_position_path_length` (m),
`eef_orientation_path_length` (degrees), `collision` (with obstacles or itself), `joint_limit_violation`, `attempts`.
What somebody else measured was not verified here, and is never stored as if it were.
"""

import json
import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from optiplan.bench.records import BenchPlanner, BenchProblem, Outcome, Row, Task, empty_row, failure
from optiplan.bench.store import Store
from optiplan.errors import InputError, Issue

EXTERNAL = "external"
"""Name of the planner of results from elsewhere."""
UNVERIFIED = "not verified here"
"""Kind of failure of a run from elsewhere that its authors call a success."""


def write_metrics(store: Store, folder: Path) -> list[Path]:
    """Write `robometrics/<planner>.json` below the folder, the first seed and repetition of each run."""
    (folder / "robometrics").mkdir(parents=True, exist_ok=True)
    written = []
    for (label,) in store.query("SELECT label FROM planners ORDER BY position"):
        sets: dict[str, list[dict[str, Any]]] = {}
        sql = "SELECT * FROM runs WHERE planner = ? AND repetition = 0 GROUP BY problem HAVING seed = min(seed)"
        for row in store.query(f"{sql} ORDER BY set_name, problem", (label,)):
            sets.setdefault(row["set_name"], []).append(_metrics(row))
        path = folder / "robometrics" / f"{label.replace(':', '_').replace('/', '_')}.json"
        path.write_text(json.dumps(sets, indent=1), encoding="utf-8")
        written.append(path)
    return written


def read_metrics(file: Path, label: str, beside: Store, folder: Path) -> int:
    """Read results from elsewhere into a folder of their own, for `optiplan bench compare`.

    Args:
        file: JSON as above; its n-th entry of a set is the n-th problem of that set in `beside`.
        label: what the planner is to be called.
        beside: our results on the same problems.
        folder: holds no results yet.

    Returns:
        Number of runs read.

    Raises:
        InputError: the file is of another form, or has a set or problems that `beside` does not have.
        StoreError: the folder cannot be written.
    """
    try:
        sets = json.loads(file.read_text(encoding="utf-8"))
        entries = [(name, index, dict(item)) for name, items in sets.items() for index, item in enumerate(items)]
    except (ValueError, AttributeError, TypeError) as error:
        raise _refused(file, str(error), "{set: [metrics, …]} in JSON") from error
    problems = [beside.problem(row["id"]) for row in beside.query("SELECT id FROM problems ORDER BY position")]
    planner = BenchPlanner(label, EXTERNAL, {"file": str(file)})
    outcomes = []
    for name, index, item in entries:
        there = [problem for problem in problems if problem.set_name == name]
        if index >= len(there):
            raise _refused(file, f"problem {index} of the set '{name}'", f"{len(there)} problems of that set, as there")
        outcomes.append(Outcome(_row(Task(there[index], planner, 0, 0, 1.0, 1.0, 1.0), item)))
    used = tuple(problem for problem in problems if any(problem.id == outcome.row.problem for outcome in outcomes))
    _store(beside, folder, (used, planner), outcomes)
    return len(outcomes)


def _store(
    beside: Store, folder: Path, parts: tuple[tuple[BenchProblem, ...], BenchPlanner], done: list[Outcome]
) -> None:
    problems, planner = parts
    there = beside.meta("parts")
    told = there | {
        "planners": {planner.label: [planner.name, dict(planner.options)]},
        "problems": {problem.id: there["problems"][problem.id] for problem in problems},
        "seeds": [0],
        "repetitions": 1,
    }
    meta = {"name": planner.label, "suite": "", "suite_hash": "", "parts": told}
    with Store.create(folder, meta) as store:
        store.fill(problems, (planner,))
        store.begin(EXTERNAL, {}, {})
        for outcome in done:
            store.add(outcome)
        store.end("complete")


def _metrics(row: Any) -> dict[str, Any]:
    """A row in their terms; what there is not is left out."""
    metrics, detail = json.loads(row["metrics"]), row["failure_detail"] or ""
    failed = [] if row["failure_kind"] != "not-verified" else detail.partition(":")[0].split(", ")
    turned = metrics.get("tool_rotation")
    found = {
        "skip": not row["timed"],
        "success": bool(row["verified"]),
        "collision": "collision" in failed,
        "joint_limit_violation": "position" in failed,
        "motion_time": row["duration"],
        "solve_time": row["plan_time"],
        "eef_position_path_length": metrics.get("tool_path"),
        "eef_orientation_path_length": None if turned is None else math.degrees(turned),
        "attempts": 1,
    }
    return {"problem": row["problem"]} | {key: value for key, value in found.items() if value is not None}


def _row(task: Task, item: Mapping[str, Any]) -> Row:
    """Their metrics as a row, which is planned and timed at most."""
    numbers = {name: _finite(item.get(name)) for name in ("motion_time", "solve_time")}
    lengths = {"tool_path": _finite(item.get("eef_position_path_length"))}
    turned = _finite(item.get("eef_orientation_path_length"))
    lengths["tool_rotation"] = None if turned is None else math.radians(turned)
    good, found = bool(item.get("success")), not item.get("skip", False)
    why = failure(UNVERIFIED if good else "failed", "as its authors tell" if good else "by its authors' own account")
    row = Row(**empty_row(task), **why, planned=found, timed=found and numbers["motion_time"] is not None)
    metrics = {name: value for name, value in lengths.items() if value is not None}
    return replace(
        row, plan_time=numbers["solve_time"], duration=numbers["motion_time"], metrics=metrics, info=dict(item)
    )


def _finite(value: Any) -> float | None:
    return float(value) if isinstance(value, int | float) and math.isfinite(value) else None


def _refused(file: Path, found: str, expected: str) -> InputError:
    return InputError([Issue(str(file), None, "results", found, expected)])
