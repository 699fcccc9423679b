"""Results in the terms of robometrics' `TrajectoryMetrics`, which cuRobo's benchmarks use too.

The file is JSON, `{set: [metrics, …]}`, each entry with the `problem` that it is of. Of its fields we have, with their
units there: `success`, `skip` (no trajectory), `motion_time` and `solve_time` (s), `eef_position_path_length` (m),
`eef_orientation_path_length` (degrees), `collision` (with obstacles or itself), `joint_limit_violation`, `attempts`.
`imported.py` reads the same form.
"""

import json
import math
from pathlib import Path
from typing import Any

from optiplan.bench.results.database import Store
from optiplan.files import write_text


def write_metrics(store: Store, folder: Path) -> list[Path]:
    """Write `robometrics/<planner>.json` below the folder, the first seed and repetition of each run."""
    written = []
    for (label,) in store.query("SELECT label FROM planners ORDER BY position"):
        sets: dict[str, list[dict[str, Any]]] = {}
        sql = "SELECT runs.* FROM runs JOIN problems ON problems.id = runs.problem WHERE planner = ? AND repetition = 0"
        first = "GROUP BY problem HAVING seed = min(seed) ORDER BY runs.set_name, problems.position"
        for row in store.query(f"{sql} {first}", (label,)):
            sets.setdefault(row["set_name"], []).append(_metrics(row))
        path = folder / "robometrics" / f"{label.replace(':', '_').replace('/', '_')}.json"
        write_text(path, json.dumps(sets, indent=1))
        written.append(path)
    return written


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
    return {"problem": row["problem"], "seed": row["seed"]} | {
        key: value for key, value in found.items() if value is not None
    }
