"""Runs of a suite as arrays: one entry per run, or a grid of tasks by planners."""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from optiplan.arrays import Array, Flags
from optiplan.bench.results.database import Store
from optiplan.records import dataclass

Indices = npt.NDArray[np.int64]

COLUMNS = (
    *("problem", "planner", "seed", "repetition", "planned", "timed", "verified", "executed"),
    *("plan_time", "plan_cpu", "duration", "ratio", "cut_short", "failure_kind"),
)
SELECT = f"SELECT {', '.join(COLUMNS)} FROM rated ORDER BY problem, planner, seed, repetition"


class Grid(NamedTuple):
    """Results on the tasks common to all planners: rows are tasks (m,), columns planners (s,).

    Attributes:
        tasks: (m, 3): problem's index, seed, repetition.
        there: (m, s): the run is stored.
        verified: (m, s).
        plan_time: (m, s), s; nan where not verified.
        duration: (m, s), s; nan where not verified.
    """

    tasks: Indices
    there: Flags
    verified: Flags
    plan_time: Array
    duration: Array


@dataclass(frozen=True)
class Runs:
    """Runs of a suite; arrays have one entry a run (n,), in the order of problem, planner, seed, repetition.

    Attributes:
        planners: labels, in the suite's order.
        problems: ids, in the suite's order.
        sets: name of each problem's set.
        difficulties: label of each problem; None without one.
        problem: (n,), index in `problems`.
        planner: (n,), index in `planners`.
        seed: (n,).
        repetition: (n,).
        planned: (n,), a path was found.
        timed: (n,), with times.
        verified: (n,), and proved.
        executed: (n,), followed by a controller: 0 or 1; nan where that was not tried.
        plan_time: (n,), s; nan where it is not known.
        plan_cpu: (n,), s, processor time of planning alone; nan where it is not known.
        duration: (n,), s; nan without a motion.
        ratio: (n,), duration / the bound of the problem, one for all its runs (`tables.VIEW`); nan without either.
        cut_short: (n,), the clock ended some of the work.
        kind: (n,), of the failure; empty where there is none.
    """

    planners: tuple[str, ...]
    problems: tuple[str, ...]
    sets: tuple[str, ...]
    difficulties: tuple[str | None, ...]
    problem: Indices
    planner: Indices
    seed: Indices
    repetition: Indices
    planned: Flags
    timed: Flags
    verified: Flags
    executed: Array
    plan_time: Array
    plan_cpu: Array
    duration: Array
    ratio: Array
    cut_short: Flags
    kind: npt.NDArray[np.str_]

    @property
    def size(self) -> int:
        """Number of runs."""
        return len(self.problem)

    def grid(self) -> Grid:
        """The runs by task and planner."""
        keys = np.column_stack([self.problem, self.seed, self.repetition])
        tasks, row = np.unique(keys.reshape(-1, 3), axis=0, return_inverse=True)
        row = row.reshape(-1)
        shape = (len(tasks), len(self.planners))

        def spread(values: Any, empty: Any) -> Any:
            full = np.full(shape, empty)
            full[row, self.planner] = values
            return full

        times, durations = (np.where(self.verified, x, np.nan) for x in (self.plan_time, self.duration))
        flags = spread(np.ones(self.size, bool), False), spread(self.verified, False)
        return Grid(tasks, *flags, spread(times, np.nan), spread(durations, np.nan))


def load_runs(store: Store) -> Runs:
    """All runs that are stored at this moment."""
    with store.of_one_moment():
        problems = store.query("SELECT id, set_name, difficulty FROM problems ORDER BY position")
        planners = tuple(row["label"] for row in store.query("SELECT label FROM planners ORDER BY position"))
        rows = [tuple(row) for batch in store.batches(SELECT) for row in batch]
    ids = tuple(row["id"] for row in problems)
    numbers = {id_: k for k, id_ in enumerate(ids)}, {label: k for k, label in enumerate(planners)}
    values = dict(zip(COLUMNS, zip(*rows, strict=True) if rows else [()] * len(COLUMNS), strict=True))

    def column(name: str, kind: Any) -> Any:
        return np.array(values[name], dtype=kind)  # NULL becomes nan

    return Runs(
        planners,
        ids,
        tuple(row["set_name"] for row in problems),
        tuple(row["difficulty"] for row in problems),
        np.array([numbers[0][name] for name in values["problem"]], dtype=np.int64),
        np.array([numbers[1][name] for name in values["planner"]], dtype=np.int64),
        **{name: column(name, np.int64) for name in ("seed", "repetition")},
        **{name: column(name, bool) for name in ("planned", "timed", "verified", "cut_short")},
        **{name: column(name, np.float64) for name in ("executed", "plan_time", "plan_cpu", "duration", "ratio")},
        kind=np.array([kind or "" for kind in values["failure_kind"]], dtype=np.str_),
    )
