"""One task, carried out: load, warm up, plan and verify, and what came of it as a row. Runs inside a worker."""

import hashlib
import json
import time
import traceback
import zlib
from collections.abc import Callable, Mapping
from typing import Any

from optiplan.bench import machine
from optiplan.bench.records import BenchProblem, Outcome, Row, Task, empty_row, failure
from optiplan.bench.robots import RobotShelf
from optiplan.errors import OptiPlanError
from optiplan.pipeline import Run, run
from optiplan.planners.base import Budget
from optiplan.problem.load import problem_from_dict
from optiplan.problem.problem import Problem
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.report import jsonable

KEPT = 4
"""Problems that stay loaded; runs come problem by problem."""

WARM_UP = {
    "version": 1,
    "name": "warm-up",
    "robot": "planar2r",
    "start": {"joints": [0.5, 1.0]},
    "goal": {"joints": [-0.5, 1.2]},
    "scene": {"obstacles": [{"name": "far", "shape": {"sphere": 0.1}, "pose": {"position": [-1.0, 0.18, 1.0]}}]},
}
"""What every planner solves once, unmeasured, in each worker: libraries are loaded and caches filled by it."""

WARM_UP_BUDGET = 0.5
"""s."""

Phase = Callable[[str], None]
"""Told `warm-up` and `run` when these begin."""


class Executor:
    """Carries out tasks one after another; keeps robots, the last problems and warm planners."""

    def __init__(self) -> None:
        self._robots = RobotShelf()
        self._problems: dict[str, Problem] = {}
        self._warm: set[str] = set()

    def __call__(self, task: Task, phase: Phase) -> Outcome:
        """The outcome; whatever goes wrong inside is one, too."""
        began, cpu = time.perf_counter(), time.process_time()
        row = {**empty_row(task), "started_at": machine.now()}
        row["load"] = machine.load()
        timings: dict[str, Any] = {}
        blob = None
        try:
            problem = self._load(task.problem, timings)
            self._warm_up(task.planner.name, task.planner.options, phase, timings)
            phase("run")
            cpu = time.process_time()
            options, budget = task.planner.options, Budget(task.budget)
            done = run(problem.with_seed(task.seed), task.planner.name, options, budget, lambda stage, part: None)
            stored, blob = packed(done.trajectory)
            columns = result_columns(done, task.metrics) | {"trajectory": stored}
            columns["cut_short"] |= done.trajectory is None and done.timings["plan"] >= task.budget
            spent = timings | {**done.timings, "stages": dict(done.stages)}
            json.dumps([columns, spent], allow_nan=False)  # a planner may tell what nobody can store
            row, timings = row | columns, spent
        except OptiPlanError as error:
            row |= failure("bad-input", str(error))
        except MemoryError:
            row |= failure("out-of-memory", "an allocation was refused")
        except BaseException as error:  # SystemExit, KeyboardInterrupt: the planner's, nobody else is here
            blob = None
            what = traceback.format_exception_only(error)[-1].strip()
            row |= failure("bug", what, {"traceback": traceback.format_exc(limit=-8)})
        row |= {"cpu_time": time.process_time() - cpu, "wall_time": time.perf_counter() - began}
        return Outcome(Row(**row, timings=timings), blob)

    def _load(self, problem: BenchProblem, timings: dict[str, Any]) -> Problem:
        began = time.perf_counter()
        if problem.hash not in self._problems:
            if len(self._problems) >= KEPT:
                del self._problems[next(iter(self._problems))]
            self._problems[problem.hash] = problem_from_dict(problem.data, "/", self._robots)
        timings["load"] = time.perf_counter() - began
        return self._problems[problem.hash]

    def _warm_up(self, name: str, options: Mapping[str, Any], phase: Phase, timings: dict[str, Any]) -> None:
        """Let the planner run once where nothing is measured; what it makes of that is of no interest."""
        if name in self._warm:
            return
        phase("warm-up")
        began = time.perf_counter()
        self._warm.add(name)
        try:
            run(problem_from_dict(WARM_UP), name, options, Budget(WARM_UP_BUDGET), lambda stage, fraction: None)
        except BaseException:  # the run itself will tell
            timings["warm_up_failed"] = True
        timings["warm_up"] = time.perf_counter() - began


def result_columns(done: Run, metrics: tuple[str, ...] | None) -> dict[str, Any]:
    """The columns that a finished run fills, its trajectory apart."""
    measured = {} if done.metrics is None else jsonable(done.metrics.to_dict())
    path_found = done.trajectory is not None or bool(done.info.get("path_found"))
    row = {
        "planned": path_found,
        "timed": done.trajectory is not None,
        "verified": done.verified,
        "plan_time": done.timings["plan"],
        "verify_time": done.timings.get("verify"),
        "duration": done.duration,
        "lower_bound": done.lower_bound,
        "ratio": done.ratio,
        "metrics": {name: measured[name] for name in (measured if metrics is None else metrics) if name in measured},
        "info": jsonable(done.info),
        "cut_short": bool(done.info.get("cut_short")),
    }
    if done.failure is not None:
        return row | failure(done.failure.kind, done.failure.detail, done.failure.witness)
    if done.report is not None and not done.verified:
        worst = done.report.failures[0]
        witness = {**worst.witness, "check": worst.name, "place": worst.place, "t": worst.time}
        names = ", ".join(check.name for check in done.report.failures)
        return row | failure("not-verified", f"{names}: {worst.detail}", witness)
    if done.report is None:
        return row | failure("bug", "the planner gave neither a trajectory nor a failure")
    return row


def packed(trajectory: Trajectory | None) -> tuple[str | None, bytes | None]:
    """SHA-256, in hex, of a trajectory's JSON, and that JSON compressed: equal if and only if the motion is."""
    if trajectory is None:
        return None, None
    text = json.dumps(trajectory.to_dict(), sort_keys=True, separators=(",", ":"), allow_nan=False).encode()
    return hashlib.sha256(text).hexdigest(), zlib.compress(text, 6)
