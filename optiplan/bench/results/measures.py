"""Every number that is stored of a run, by name: its label, its unit, its values; and every answer on the way."""

import json
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from optiplan.arrays import Array, Flags
from optiplan.bench.results.arrays import Indices, Runs, load_runs
from optiplan.bench.results.database import Store
from optiplan.records import dataclass
from optiplan.robot.limits import joint_units

ORDER = "ORDER BY problem, planner, seed, repetition"
"""That of `Runs`."""

COLUMNS = {
    "plan_time": ("planning time", "s", 1.0),
    "plan_cpu": ("processor time of planning", "s", 1.0),
    "verify_time": ("time of the proof", "s", 1.0),
    "duration": ("duration", "s", 1.0),
    "ratio": ("duration / bound", "", 1.0),
    "memory": ("memory", "MB", 1.0),
}
"""Columns of `rated` that are measures: label, unit, and the factor that makes the stored number one in this unit."""

METRICS = {
    "tool_path": ("path of the tool", "m", 1.0),
    "tool_rotation": ("turning of the tool", "rad", 1.0),
    "joint_path": ("path of the joints", joint_units("position"), 1.0),
    "clearance": ("clearance, proved", "mm", 1e3),
    "scene_clearance": ("clearance from the scene, proved", "mm", 1e3),
    "self_clearance": ("clearance of the robot from itself, proved", "mm", 1e3),
    "lowest_clearance": ("smallest distance met", "mm", 1e3),
    "peak_jerk": ("largest jerk", joint_units("jerk"), 1.0),
    "jerk_share": ("largest jerk / limit", "", 1.0),
    "rms_torque": ("torque, rms", joint_units("torque"), 1.0),
    "manipulability": ("least manipulability", "", 1.0),
}
"""The same of the numbers in column `metrics`; one that is not listed here is shown under its own name."""

LOOKED_AT = 2000
"""Runs whose metrics are looked at for names."""


@dataclass(frozen=True)
class RunMeasure:
    """One number of all runs: key, label, unit, and values (n,), nan where there is none."""

    name: str
    label: str
    unit: str
    values: Array

    @property
    def title(self) -> str:
        """Label and unit."""
        return f"{self.label}, {self.unit}" if self.unit else self.label


@dataclass(frozen=True)
class RunAnswers:
    """Verified answers on the way, m of them, in order of runs and of time.

    Attributes:
        run: (m,), index in `Runs`.
        seconds: (m,), s of planning and proving.
        duration: (m,), s, of the motion.
    """

    run: Indices
    seconds: Array
    duration: Array


@dataclass(frozen=True)
class Results:
    """Everything that a report is made of: runs, their measures, their answers on the way.

    `known` (problems,), s, is the best known duration of each problem from a table, inf where there is none.
    """

    runs: Runs
    measures: tuple[RunMeasure, ...]
    answers: RunAnswers
    known: Array

    def of_set(self, name: str) -> "Results":
        """Those of one set of problems."""
        runs = self.runs
        kept = np.array([one == name for one in runs.sets], dtype=bool)
        mask = kept[runs.problem] if len(kept) else np.zeros(0, bool)
        measures = tuple(replace(one, values=one.values[mask]) for one in self.measures)
        return Results(_some_runs(runs, kept, mask), measures, _some_answers(self.answers, mask), self.known[kept])


def load_results(store: Store) -> Results:
    """All that is stored at this moment."""
    with store.of_one_moment():
        return _results(store)


def _results(store: Store) -> Results:
    names = _metric_names(store)
    picked = [f"json_extract(metrics, '$.\"{name}\"')" for name in names]
    columns = ", ".join([*COLUMNS, *picked, "improvements", "verified", "verify_time"])
    rows = [tuple(row) for batch in store.batches(f"SELECT {columns} FROM rated {ORDER}") for row in batch]
    known = [(name, *COLUMNS[name]) for name in COLUMNS]
    known += [(name, *METRICS.get(name, (name.replace("_", " "), "", 1.0))) for name in names]
    measures = []
    for k, (name, label, unit, factor) in enumerate(known):
        values = factor * np.array([_number(row[k]) for row in rows], dtype=np.float64)
        if np.isfinite(values).any():
            measures.append(RunMeasure(name, label, unit, values))
    runs = load_runs(store)
    return Results(runs, tuple(measures), _answers(rows), _best_known(store, runs.problems))


def _best_known(store: Store, problems: Sequence[str]) -> Array:
    """Best known durations, s, as a table had them when the suite was held against it; inf where it had none."""
    table = store.meta("best_known", {})
    return np.array([table.get(problem, np.inf) for problem in problems], dtype=np.float64)


def _metric_names(store: Store) -> list[str]:
    """Names of numbers in column `metrics`, those that we know first."""
    sql = (
        "SELECT DISTINCT key FROM (SELECT metrics FROM runs WHERE timed LIMIT ?) AS some, json_each(some.metrics) "
        "WHERE json_each.type IN ('integer', 'real')"
    )
    found = [str(row[0]) for row in store.query(sql, (LOOKED_AT,)) if '"' not in str(row[0])]
    return [name for name in METRICS if name in found] + sorted(set(found) - set(METRICS))


def _answers(rows: Sequence[tuple[Any, ...]]) -> RunAnswers:
    """RunAnswers on the way; of a verified run of a release that recorded none its end."""
    run, seconds, duration = [], [], []
    plan, length = list(COLUMNS).index("plan_time"), list(COLUMNS).index("duration")
    for k, row in enumerate(rows):
        improvements, verified, proving = row[-3:]
        found = json.loads(improvements) if improvements else []
        if verified and not found and row[plan] is not None and row[length] is not None:
            found = [(row[plan] + (proving or 0.0), row[length])]
        for when, best in found:
            run.append(k)
            seconds.append(when)
            duration.append(best)
    return RunAnswers(np.array(run, dtype=np.int64), np.array(seconds, dtype=float), np.array(duration, dtype=float))


def _some_runs(runs: Runs, kept: Flags, mask: Flags) -> Runs:
    """The runs of the problems that are kept (m,), which `mask` (n,) marks."""
    number = np.cumsum(kept) - 1
    changes: dict[str, Any] = {name: value[mask] for name, value in vars(runs).items() if isinstance(value, np.ndarray)}
    for name in ("problems", "sets", "difficulties"):
        changes[name] = tuple(one for one, keep in zip(getattr(runs, name), kept, strict=True) if keep)
    return replace(runs, **changes | {"problem": number[runs.problem[mask]]})


def _some_answers(answers: RunAnswers, mask: Flags) -> RunAnswers:
    number, there = np.cumsum(mask) - 1, mask[answers.run]
    return RunAnswers(number[answers.run[there]], answers.seconds[there], answers.duration[there])


def _number(value: Any) -> float:
    return float(value) if isinstance(value, int | float) else float("nan")
