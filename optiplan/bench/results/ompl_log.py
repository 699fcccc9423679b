"""Results as logs of OMPL's `Benchmark` class, which Planner Arena and `ompl_benchmark_statistics.py` read.

A log holds one experiment: a set of problems. Planners follow one another, each with its settings, the names and types
of its properties (REAL, INTEGER, BOOLEAN, ENUM), and one line of values a run, each followed by `; `. A value that is
not known stays empty. Progress within a run is not recorded.
"""

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import optiplan
from optiplan.bench.results.database import Store
from optiplan.files import write_text

STATUS = (
    "Unknown status",
    "Invalid start",
    "Invalid goal",
    "Unrecognized goal type",
    "Timeout",
    "Approximate solution",
    "Exact solution",
    "Crash",
)
"""OMPL's own words in its own order; a run is named by its place."""

PROPERTIES = {
    "approximate solution": "BOOLEAN",
    "correct solution": "BOOLEAN",
    "cut short": "BOOLEAN",
    "duration": "REAL",
    "failure": "ENUM",
    "memory": "REAL",
    "problem": "ENUM",
    "ratio": "REAL",
    "repetition": "INTEGER",
    "seed": "INTEGER",
    "solution clearance": "REAL",
    "solution length": "REAL",
    "solved": "BOOLEAN",
    "status": "ENUM",
    "time": "REAL",
    "tool path": "REAL",
    "verification time": "REAL",
}
"""Of a run: time, verification time and duration in s, memory in MB, `solution length` of the path of the joints, rad,
`tool path` and `solution clearance` in m. Solved means verified; `approximate` a motion that the verifier refused."""


KINDS = "SELECT DISTINCT failure_kind FROM runs WHERE failure_kind IS NOT NULL ORDER BY 1"


def write_logs(store: Store, folder: Path) -> list[Path]:
    """Write `ompl/<set>.log` below the folder, one log a set of problems.

    Raises:
        OSError: a file cannot be written.
    """
    written = []
    for (name,) in store.query("SELECT DISTINCT set_name FROM runs ORDER BY 1"):
        path = folder / "ompl" / f"{name}.log"
        write_text(path, "\n".join(_lines(store, name)) + "\n")
        written.append(path)
    return written


def _lines(store: Store, name: str) -> Iterator[str]:
    parts = store.meta("parts")
    session = store.query("SELECT * FROM sessions ORDER BY session LIMIT 1")[0]
    machine = json.loads(session["machine"])
    spent = store.query("SELECT coalesce(sum(wall_time), 0) FROM runs WHERE set_name = ?", (name,))[0][0]
    enums = {
        "failure": ("none", *_column(store, KINDS)),
        "problem": _column(store, "SELECT id FROM problems ORDER BY position"),
        "status": STATUS,
    }
    runs = {
        label: _runs(store, name, label) for label in _column(store, "SELECT label FROM planners ORDER BY position")
    }
    yield f"OptiPlan version {optiplan.__version__}"
    yield f"Experiment {_word(store.meta('name'))}/{_word(name)}"
    yield "0 experiment properties"
    yield f"Running on {_word(machine.get('host', '')) or 'UNKNOWN'}"
    yield f"Starting at {session['started_at']}"
    yield from ("<<<|", f"set {name} of the suite {store.meta('name')}", "|>>>")
    where = f"{machine['cpu']}, {machine['cores']} cores" if "cpu" in machine else "imported"
    yield from ("<<<|", where, "|>>>")
    yield f"{parts['seeds'][0]} is the random seed"
    yield f"{parts['budget']:g} seconds per run"
    yield f"{parts['limits']['memory']:g} MB per run"
    yield f"{max(map(len, runs.values()))} runs per planner"
    yield f"{spent:.6f} seconds spent to collect the data"
    yield f"{len(enums)} enum types"
    yield from ("|".join((title, *words)) for title, words in enums.items())
    yield f"{len(runs)} planners"
    for label, rows in runs.items():
        yield from _planner(store, label, rows, enums)


def _planner(store: Store, label: str, rows: list[Any], enums: Mapping[str, tuple[str, ...]]) -> Iterator[str]:
    (planner,) = store.query("SELECT name, options FROM planners WHERE label = ?", (label,))
    settings = {"planner": planner["name"], **json.loads(planner["options"])}
    yield label
    yield f"{len(settings)} common properties"
    yield from (f"{key} = {value}" for key, value in sorted(settings.items()))
    yield f"{len(PROPERTIES)} properties for each run"
    yield from (f"{key} {kind}" for key, kind in PROPERTIES.items())
    yield f"{len(rows)} runs"
    for row in rows:
        values = _values(row, enums)
        yield "".join(f"{'' if values[key] is None else values[key]}; " for key in PROPERTIES)
    yield "."


def _runs(store: Store, name: str, label: str) -> list[Any]:
    sql = "SELECT * FROM rated WHERE set_name = ? AND planner = ? ORDER BY problem, seed, repetition"
    return store.query(sql, (name, label))


def _values(row: Any, enums: Mapping[str, tuple[str, ...]]) -> dict[str, Any]:
    metrics = json.loads(row["metrics"])
    approximate = int(row["timed"] and not row["verified"])
    return {
        "approximate solution": approximate,
        "correct solution": row["verified"],
        "cut short": row["cut_short"],
        "duration": row["duration"],
        "failure": enums["failure"].index(row["failure_kind"] or "none"),
        "memory": row["memory"],
        "problem": enums["problem"].index(row["problem"]),
        "ratio": row["ratio"],
        "repetition": row["repetition"],
        "seed": row["seed"],
        "solution clearance": metrics.get("clearance"),
        "solution length": metrics.get("joint_path"),
        "solved": row["verified"],
        "status": STATUS.index(_status(row, approximate)),
        "time": row["plan_time"],
        "tool path": metrics.get("tool_path"),
        "verification time": row["verify_time"],
    }


def _status(row: Any, approximate: int) -> str:
    kind = row["failure_kind"] or ""
    if row["verified"] or approximate:
        return "Exact solution" if row["verified"] else "Approximate solution"
    if kind in ("timeout", "budget"):
        return "Timeout"
    return "Crash" if kind.startswith(("crashed", "bug", "out-of-memory")) else "Unknown status"


def _column(store: Store, sql: str) -> tuple[str, ...]:
    return tuple(str(row[0]) for row in store.query(sql))


def _word(text: str) -> str:
    """Names are read as the last word of a line."""
    return "_".join(text.split())
