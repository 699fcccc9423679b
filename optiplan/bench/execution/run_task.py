"""Execute one task inside a worker: load, warm up, plan and verify, and return the result as a row."""

import hashlib
import json
import random
import time
import traceback
import zlib
from collections.abc import Callable
from typing import Any

import numpy as np

from optiplan.bench.execution import machine
from optiplan.bench.execution.code_version import own_digest, planner_code
from optiplan.bench.execution.executed import executed, only_wanted
from optiplan.bench.execution.robot_cache import RobotCache
from optiplan.bench.results.records import (
    BenchPlanner,
    BenchProblem,
    BenchTask,
    ChangedError,
    Outcome,
    Row,
    empty_row,
    failure,
)
from optiplan.cache import MostRecent
from optiplan.errors import OptiPlanError, PlannerAnswerError
from optiplan.planners.base import Budget, silent
from optiplan.planners.registry import load_libraries
from optiplan.problem.goals import listed_ends
from optiplan.problem.load import problem_from_dict
from optiplan.problem.problem import Problem
from optiplan.runs.pipeline import processor_time, reserve, run
from optiplan.runs.run import Run
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.report import jsonable

KEPT = 4
"""Problems that stay loaded; runs come problem by problem."""

WARM_UP_BUDGET = 0.5
"""s."""
WARM_UP_STEP = 0.05
"""Share of the way from the start to the middle of the joints' ranges that is planned to warm up."""
KEPT_KEYS = ("version", "robot", "locked", "group", "start", "limits")
"""What a problem to warm up with has in common with the one that is to come."""

Phase = Callable[[str], None]
"""Told `warm-up` and `run` when these begin."""


class TaskExecutor:
    """Execute tasks in turn; robots, the last problems and warm planners are cached."""

    def __init__(self) -> None:
        self._robots = RobotCache()
        self._problems: MostRecent[Problem] = MostRecent(KEPT)
        self._warm: set[tuple[str, ...]] = set()
        self._codes: dict[str, str] = {}

    def __call__(self, task: BenchTask, phase: Phase) -> Outcome:
        """Return the outcome; any error inside is an outcome too."""
        began, cpu = time.perf_counter(), processor_time()
        row = {**empty_row(task), "started_at": machine.now(), "optiplan": own_digest()}
        row["code"] = self._code(task.planner)
        row["load"] = machine.load_average()
        timings: dict[str, Any] = {}
        blob = None
        try:
            problem = self._load(task.problem, timings)
            self._warm_up(task.planner, problem, phase, timings)
            phase("run")
            forget(task.seed)
            cpu = processor_time()
            options, budget = task.planner.options, Budget(task.budget)
            done = run(problem.with_seed(task.seed), task.planner.name, options, budget, lambda stage, part: None)
            stored, packed = hash_and_pack(done.trajectory)
            columns = result_columns(done, task.metrics) | {"trajectory": stored}
            columns["cut_short"] |= done.trajectory is None and done.timings["plan"] >= task.budget - reserve(
                task.budget
            )
            began_execution = time.perf_counter()
            columns["executed"], numbers = executed(done)
            columns["metrics"] |= jsonable(only_wanted(numbers, task.metrics))
            spent = timings | {**done.timings, "stages": dict(done.stages)}
            if columns["executed"] is not None:
                spent["execute"] = time.perf_counter() - began_execution
            json.dumps([columns, spent], allow_nan=False)  # a planner's info may not be storable
            row, timings, blob = row | columns, spent, packed
        except PlannerAnswerError as error:
            row |= failure("bug", str(error))
        except ChangedError as error:
            row |= failure("changed", str(error))
        except OptiPlanError as error:
            row |= failure("bad-input", str(error))
        except MemoryError:
            row |= failure("out-of-memory", "an allocation was refused")
        except BaseException as error:  # SystemExit and KeyboardInterrupt can only come from the planner
            what = traceback.format_exception_only(error)[-1].strip()
            row |= failure("bug", what, {"traceback": traceback.format_exc(limit=-8)})
        row |= {"cpu_time": processor_time() - cpu, "wall_time": time.perf_counter() - began}
        return Outcome(Row(**row, timings=timings), blob)

    def _load(self, problem: BenchProblem, timings: dict[str, Any]) -> Problem:
        began = time.perf_counter()
        found = self._problems.get(problem.id, lambda: problem_from_dict(problem.data, "/", self._robots))
        problem.check_unchanged(found.hash)
        timings["load"] = time.perf_counter() - began
        return found

    def _code(self, planner: BenchPlanner) -> str:
        """The planner's code as it was before its first use here."""
        if planner.label not in self._codes:
            self._codes[planner.label] = planner_code(planner.name, planner.options)
        return self._codes[planner.label]

    def _warm_up(self, planner: BenchPlanner, problem: Problem, phase: Phase, timings: dict[str, Any]) -> None:
        """Run the planner once on a simple problem of this robot, unmeasured, and discard the result.

        Libraries are loaded, code compiled and caches filled by it: by planner, by its options, and by robot.
        """
        key = (planner.label, *(json.dumps(problem.source.get(name)) for name in ("robot", "locked", "group")))
        if key in self._warm:
            return
        phase("warm-up")
        began = time.perf_counter()
        self._warm.add(key)
        try:
            easy = problem_from_dict(warm_up_problem(problem), "/", self._robots)
            load_libraries(planner.name)  # of which an easy problem may need none
            run(easy, planner.name, planner.options, Budget(WARM_UP_BUDGET), silent)
        except BaseException:  # the run itself will tell
            timings["warm_up_failed"] = True
        timings["warm_up"] = time.perf_counter() - began


def warm_up_problem(problem: Problem) -> dict[str, Any]:
    """Return problem data: the same robot and start, no obstacles, a short motion to a joint goal."""
    limits = problem.robot.limits
    middle = np.clip(problem.start, limits.lower, limits.upper)
    bounded = np.isfinite(limits.lower) & np.isfinite(limits.upper)
    middle = np.where(bounded, 0.5 * (limits.lower + limits.upper), middle + 1.0)
    goal = problem.start + WARM_UP_STEP * (middle - problem.start)
    chosen = {key: problem.source[key] for key in KEPT_KEYS if key in problem.source}
    return chosen | {"name": "warm-up", "goal": {"joints": goal.tolist()}}


def forget(seed: int) -> None:
    """Seed the process-wide generators, so that runs do not influence each other."""
    random.seed(seed)
    np.random.seed(seed)  # noqa: NPY002


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
        "goal_bound": goal_bound(done.problem),
        "plan_cpu": done.plan_cpu,
        "metrics": {name: measured[name] for name in (measured if metrics is None else metrics) if name in measured},
        "info": jsonable(done.info),
        "improvements": jsonable(done.improvements),
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


def goal_bound(problem: Problem) -> float | None:
    """Least duration from the start to any of the configurations that the problem lists as its goal, s; None: none.

    Obstacles are ignored, and so are goals that are stated as poses: which configurations reach these is found by runs.
    """
    listed = listed_ends(problem)
    return float(problem.lower_bounds(listed).min()) if listed else None


def hash_and_pack(trajectory: Trajectory | None) -> tuple[str | None, bytes | None]:
    """SHA-256, in hex, of a trajectory's JSON, and that JSON compressed: equal if and only if the motion is."""
    if trajectory is None:
        return None, None
    text = json.dumps(trajectory.to_dict(), sort_keys=True, separators=(",", ":"), allow_nan=False).encode()
    return hashlib.sha256(text).hexdigest(), zlib.compress(text, 6)
