"""Records exchanged between the runner and its workers, and stored: plain data, JSON-ready."""

from collections.abc import Mapping, Sequence
from dataclasses import field, fields
from typing import Any, Literal

from optiplan.errors import OptiPlanError
from optiplan.planners.base import FailureKind
from optiplan.records import dataclass
from optiplan.verify.report import jsonable

Key = tuple[str, str, int, int]
"""Problem id, planner's label, seed, repetition: what makes a run one of its kind."""

RunFailureKind = Literal[
    "not-verified",
    "bad-input",
    "changed",
    "timeout",
    "out-of-memory",
    "crashed",
    "crashed (machine lost)",
    "failed",
    "not verified here",
]
"""Why a run of a benchmark has no verified trajectory, besides the reasons that planners give (`FailureKind`).

* `not-verified`: the planner gave a trajectory that the verifier refuses.
* `bad-input`: the planner refused the problem or its options.
* `changed`: files of the problem are others than when the suite was read; it ends the suite and is not stored.
* `timeout`, `out-of-memory`, `crashed`: the worker was ended at a hard limit, or ended by itself.
* `crashed (machine lost)`: of a cluster, the computer that made it was lost, more than once.
* `failed`, `not verified here`: of results from elsewhere, by their authors' own account.
"""

CHANGED = "its robot or its meshes were changed since the suite was read: run it into another folder"
"""Why no run is made or verified with the files that are there now."""


class ChangedError(OptiPlanError):
    """Files or code that were changed since a suite was read."""


@dataclass(frozen=True)
class BenchProblem:
    """A problem of a suite.

    Attributes:
        id: unique in the suite, `<set>/<name>`.
        set_name: the set it belongs to.
        difficulty: label; None without one.
        hash: `Problem.hash`, the identity of its content; empty where its files came from another machine.
        data: content of a problem file, with absolute paths to meshes and to a robot that is not shipped.
        origin: where it came from.
    """

    id: str
    set_name: str
    difficulty: str | None
    hash: str
    data: Mapping[str, Any]
    origin: Mapping[str, Any]

    def check_unchanged(self, now: str) -> None:
        """Refuse a problem whose hash is another one now.

        Raises:
            ChangedError: its files were changed.
        """
        if self.hash and now != self.hash:
            raise ChangedError(f"{self.id}: {CHANGED}")


@dataclass(frozen=True)
class BenchPlanner:
    """A planner of a suite: its label in the results, its name in the registry, its options."""

    label: str
    name: str
    options: Mapping[str, Any]


@dataclass(frozen=True)
class BenchTask:
    """One run to be made.

    Attributes:
        problem: what to plan.
        planner: the planner.
        seed: replaces the problem's own.
        repetition: from 0.
        budget: s, of the planner.
        wall: hard limit of wall-clock time, s.
        memory: hard limit of resident memory, MB.
        metrics: names of the numbers to keep; None keeps all.
    """

    problem: BenchProblem
    planner: BenchPlanner
    seed: int
    repetition: int
    budget: float
    wall: float
    memory: float
    metrics: tuple[str, ...] | None = None

    @property
    def key(self) -> Key:
        """Identity of the run: problem, planner, seed, repetition."""
        return self.problem.id, self.planner.label, self.seed, self.repetition

    def to_dict(self) -> dict[str, Any]:
        """JSON-ready form, inverse of `from_dict`."""
        return vars(self) | {"problem": vars(self.problem), "planner": vars(self.planner)}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> "BenchTask":
        """Read the result of `to_dict`."""
        metrics = None if data["metrics"] is None else tuple(data["metrics"])
        parts = {"problem": BenchProblem(**data["problem"]), "planner": BenchPlanner(**data["planner"])}
        return cls(**{**data, **parts, "metrics": metrics})


@dataclass(frozen=True)
class Row:
    """One row of table `runs`; docs/how-to/benchmarks.md says what each column means. Times in s, memory in MB."""

    problem: str
    planner: str
    seed: int
    repetition: int
    set_name: str
    difficulty: str | None
    planned: bool = False
    timed: bool = False
    verified: bool = False
    executed: bool | None = None
    plan_time: float | None = None
    verify_time: float | None = None
    duration: float | None = None
    lower_bound: float | None = None
    goal_bound: float | None = None
    failure_kind: str | None = None
    failure_detail: str | None = None
    witness: Mapping[str, Any] | None = None
    metrics: Mapping[str, Any] = field(default_factory=dict)
    timings: Mapping[str, Any] = field(default_factory=dict)
    info: Mapping[str, Any] = field(default_factory=dict)
    improvements: Sequence[Sequence[float]] = ()
    cut_short: bool = False
    trajectory: str | None = None
    output: str = ""
    plan_cpu: float | None = None
    cpu_time: float | None = None
    memory: float | None = None
    wall_time: float | None = None
    worker: str = ""
    load: float | None = None
    started_at: str = ""
    optiplan: str = ""
    code: str = ""

    @property
    def key(self) -> Key:
        """Identity of the run: problem, planner, seed, repetition."""
        return self.problem, self.planner, self.seed, self.repetition


COLUMNS = tuple(item.name for item in fields(Row))


def empty_row(task: BenchTask) -> dict[str, Any]:
    """The columns of a row that are known before the run."""
    problem, planner, seed, repetition = task.key
    row = {"problem": problem, "planner": planner, "seed": seed, "repetition": repetition}
    return {**row, "set_name": task.problem.set_name, "difficulty": task.problem.difficulty}


def failure(
    kind: FailureKind | RunFailureKind, detail: str, witness: Mapping[str, Any] | None = None, how: str = ""
) -> dict[str, Any]:
    """Return the columns of a failure; `how`, in words, belongs to the kind."""
    told = f"{kind} ({how})" if how else str(kind)
    told, detail = (text.encode(errors="replace").decode() for text in (told, detail))  # databases hold UTF-8 alone
    return {"failure_kind": told, "failure_detail": detail, "witness": None if witness is None else jsonable(witness)}


@dataclass(frozen=True)
class Outcome:
    """Outcome of a task: its row, and the trajectory as compressed JSON when there is one."""

    row: Row
    trajectory: bytes | None = None
