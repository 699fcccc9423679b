"""The results for other programs: tables as CSV and Parquet, problems as files, metrics as robometrics has them."""

import csv
import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from optiplan.bench.results.database import Store
from optiplan.errors import OptiPlanError
from optiplan.files import replacing, write_text
from optiplan.problem.write import problem_text

FORMATS = ("csv", "parquet")
TABLES = ("runs", "problems", "planners", "sessions")
"""Tables that are written; `meta` (the suite, its code) and the trajectories stay in the database."""

TYPES = {"INTEGER": "int64", "REAL": "float64", "TEXT": "string"}
"""SQLite's types and Arrow's."""

FLAGS = ("planned", "timed", "verified", "executed", "cut_short")
"""Columns of `runs` that are true or false."""

RATED = {"problem_bound": "REAL", "ratio": "REAL"}
"""Columns that `runs` is written with and that are computed: one bound a problem, and the duration by it."""

ORDER = {"runs": "problem, planner, seed, repetition", "sessions": "session"}


def export_results(store: Store, folder: Path, kind: str) -> list[Path]:
    """Write each table of `TABLES` as `<table>.<kind>`; files appear whole or not at all.

    Args:
        store: the results.
        folder: made when it is not there.
        kind: `csv` (JSON columns as text, flags as 0 and 1, NULL as nothing) or `parquet` (needs pyarrow).

    Returns:
        The files.

    Raises:
        OptiPlanError: pyarrow is not installed.
        OSError: a file cannot be written.
    """
    write = _write_csv if kind == "csv" else _write_parquet
    written = []
    for table in TABLES:
        path = folder / f"{table}.{kind}"
        with replacing(path) as temporary:
            write(store, table, temporary)
        written.append(path)
    return written


def write_problems(store: Store, folder: Path) -> list[Path]:
    """Write each problem as a problem file, `problems/<set>/<name>.yaml`: scenes that were generated, too.

    Returns:
        The files.

    Raises:
        OSError: a file cannot be written.
    """
    written = []
    for row in store.query("SELECT id, data, origin FROM problems ORDER BY position"):
        path = folder / "problems" / f"{row['id']}.yaml"
        write_text(path, problem_text(json.loads(row["data"]), f"{row['id']}: {row['origin']}"))
        written.append(path)
    return written


def write_metrics(store: Store, folder: Path) -> list[Path]:
    """Write `robometrics/<planner>.json` below the folder, the first seed and repetition of each run.

    Each file is JSON, `{set: [metrics, …]}`, in the terms of robometrics' `TrajectoryMetrics`, which cuRobo's
    benchmarks use too: `success`, `skip` (no trajectory), `motion_time` and `solve_time` (s),
    `eef_position_path_length` (m), `eef_orientation_path_length` (degrees), `collision` (with obstacles or itself),
    `joint_limit_violation`, `attempts`, and the `problem`. `imported.py` reads the same form.
    """
    written: list[Path] = []
    for (label,) in store.query("SELECT label FROM planners ORDER BY position"):
        sets: dict[str, list[dict[str, Any]]] = {}
        sql = "SELECT runs.* FROM runs JOIN problems ON problems.id = runs.problem WHERE planner = ? AND repetition = 0"
        first = "GROUP BY problem HAVING seed = min(seed) ORDER BY runs.set_name, problems.position"
        for row in store.query(f"{sql} {first}", (label,)):
            sets.setdefault(row["set_name"], []).append(_metrics(row))
        path = folder / "robometrics" / f"{label.replace(':', '_').replace('/', '_')}.json"
        while path in written:  # of `a:b` and `a_b`
            path = path.with_stem(f"{path.stem}_")
        write_text(path, json.dumps(sets, indent=1))
        written.append(path)
    return written


def columns_of(store: Store, table: str) -> dict[str, str]:
    """The columns of a table and their types, in order; of `runs` those of the view `rated`."""
    return {
        row["name"]: RATED.get(row["name"], row["type"]) for row in store.query(f"PRAGMA table_info({_from(table)})")
    }


def _batches(store: Store, table: str) -> Iterator[list[Any]]:
    return store.batches(f"SELECT * FROM {_from(table)} ORDER BY {ORDER.get(table, 'position')}")


def _write_csv(store: Store, table: str, path: Path) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(columns_of(store, table))
        for rows in _batches(store, table):
            writer.writerows(rows)


def _write_parquet(store: Store, table: str, path: Path) -> None:
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ImportError as error:
        raise OptiPlanError("Parquet needs pyarrow: pip install 'optiplan[results]' (or --format csv)") from error
    kinds = {name: "bool" if name in FLAGS else TYPES[kind] for name, kind in columns_of(store, table).items()}
    schema = pa.schema([(name, getattr(pa, "bool_" if kind == "bool" else kind)()) for name, kind in kinds.items()])
    with pq.ParquetWriter(path, schema, compression="zstd") as writer:
        for rows in _batches(store, table):
            arrays = [
                pa.array([_flag(row[name]) if kind == "bool" else row[name] for row in rows], schema.field(name).type)
                for name, kind in kinds.items()
            ]
            writer.write_table(pa.Table.from_arrays(arrays, schema=schema))


def _from(table: str) -> str:
    return "rated" if table == "runs" else table


def _flag(value: int | None) -> bool | None:
    return None if value is None else bool(value)


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
