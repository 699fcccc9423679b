"""Import of foreign results: times as their authors report, trajectories verified here.

The file is JSON: `{set: [entry, …]}` as robometrics has it, or `[entry, …]`. An entry is matched by its `problem`, the
id that we use, and its `seed` (0 without one). It may have the fields of `export.write_metrics`, and a `trajectory`:
samples `{"t": [s, …], "q": [[rad, …], …]}`, with `v`, `a` and `joint_names` if there are, or the path of a JSON or CSV
file of them, relative to the results. What has a trajectory is verified here, and its duration is that of the
trajectory; what has none counts as planned and timed, never as verified.
"""

import json
import math
import sys
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final, NamedTuple

from optiplan.bench.execution.robot_cache import RobotCache
from optiplan.bench.execution.run_task import hash_and_pack, result_columns
from optiplan.bench.results.database import Store
from optiplan.bench.results.records import BenchPlanner, BenchTask, Outcome, Row, empty_row, failure
from optiplan.config.messages import some
from optiplan.errors import InputError, Issue, OptiPlanError, os_reason
from optiplan.problem.load import problem_from_dict
from optiplan.problem.problem import Problem
from optiplan.runs.metrics import measure
from optiplan.runs.run import Run
from optiplan.trajectory.sample_file import Samples, read_samples, samples_from_dict
from optiplan.verify.report import jsonable
from optiplan.verify.verify import verify

EXTERNAL = "external"
"""Name of the planner of results from elsewhere."""
CLAIMED: Final = "not verified here"
"""Kind of failure of a run from elsewhere that its authors call a success and that has no trajectory."""
_SEEDS = 2**63
"""The first seed that the database cannot hold."""
FORM = "{set: [entry, …]} or [entry, …] in JSON"


class Entry(NamedTuple):
    """One run of the file: its place there, and its fields."""

    place: str
    fields: Mapping[str, Any]


class Imported(NamedTuple):
    """Number of runs read, of those with a trajectory, and of those verified."""

    runs: int
    trajectories: int
    verified: int


def read_results(file: Path, label: str, beside: Store, folder: Path) -> Imported:
    """Read foreign results into a folder of their own, for `optiplan bench compare`.

    Args:
        file: as the module says.
        label: name of the planner.
        beside: our results on the same problems.
        folder: holds no results yet.

    Raises:
        InputError: the file is of another form, names problems that `beside` does not have or one of them twice, or
            has samples that cannot be read; holds every issue found.
        ChangedError: a motion cannot be verified with the robot and meshes that `beside` was made with.
        StoreError: the folder cannot be written.
    """
    planner = BenchPlanner(label, EXTERNAL, {"file": str(file)})
    tasks: dict[tuple[str, int], tuple[BenchTask, Entry]] = {}
    issues: list[Issue] = []
    ids = [row["id"] for row in beside.query("SELECT id FROM problems ORDER BY position")]
    for entry in _entries(file):
        problem, seed = entry.fields.get("problem"), entry.fields.get("seed", 0)
        if not isinstance(problem, str) or problem not in ids:
            found = f"{entry.place}: problem {problem!r}" if "problem" in entry.fields else f"{entry.place}: no problem"
            issues.append(Issue(str(file), None, "problem", found, f"an id of {beside.folder}: {some(ids, 3)}"))
        elif not isinstance(seed, int) or isinstance(seed, bool) or not -_SEEDS <= seed < _SEEDS:
            issues.append(Issue(str(file), None, "seed", f"{entry.place}: {seed!r}", "a whole number of 64 bits"))
        elif (problem, seed) in tasks:
            found = f"{entry.place}: '{problem}', seed {seed} a second time"
            issues.append(Issue(str(file), None, "problem", found, "one entry for each problem and seed"))
        else:
            tasks[problem, seed] = BenchTask(beside.problem(problem), planner, seed, 0, 1.0, 1.0, 1.0), entry
    if issues:
        raise InputError(issues)
    done = list(_outcomes(file, tasks))
    _store(beside, folder, planner, done)
    rows = [outcome.row for outcome in done]
    return Imported(len(rows), sum(row.trajectory is not None for row in rows), sum(row.verified for row in rows))


def _entries(file: Path) -> list[Entry]:
    """The runs of the file, in its order."""
    try:
        data = json.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        what = os_reason(error)
        raise InputError([Issue(str(file), None, "results", what, "a file of results")]) from error
    except (ValueError, RecursionError) as error:
        raise InputError([Issue(str(file), None, "results", str(error), FORM)]) from error
    lists: Mapping[str, Any] = data if isinstance(data, Mapping) else {"": data}
    found: list[Entry] = []
    for name, items in lists.items():
        if not isinstance(items, list) or not all(isinstance(item, Mapping) for item in items):
            raise InputError([Issue(str(file), None, name or "results", "something else", FORM)])
        of_set = f" of {name}" if name else ""
        found += [Entry(f"entry {index}{of_set}", item) for index, item in enumerate(items)]
    return found


def _outcomes(file: Path, tasks: Mapping[Any, tuple[BenchTask, Entry]]) -> Iterator[Outcome]:
    """Return the outcome of every entry.

    Raises:
        InputError: samples that cannot be read, of all entries.
        ChangedError: as `read_results`.
    """
    robots = RobotCache()
    issues: list[Issue] = []
    found: list[Outcome] = []
    for task, entry in tasks.values():
        row = _claimed_row(task, entry.fields)
        given = entry.fields.get("trajectory")
        if given is None:
            found.append(Outcome(row))
            continue
        try:
            problem = problem_from_dict(task.problem.data, "/", robots)
        except OptiPlanError as error:
            found.append(Outcome(replace(row, **failure("bad-input", str(error)))))
            continue
        task.problem.check_unchanged(problem.hash)
        try:
            found.append(_judged(row, problem, _samples(file, entry, given, problem)))
        except InputError as error:
            issues += error.issues
    if issues:
        raise InputError(issues)
    yield from found


def _samples(file: Path, entry: Entry, given: Any, problem: Problem) -> Samples:
    names = problem.robot.joint_names
    if isinstance(given, str):
        return read_samples(file.parent / given, names)
    return samples_from_dict(given, f"{file}: {entry.place}: trajectory", names)


def _judged(row: Row, problem: Problem, samples: Samples) -> Outcome:
    """Return the row of a motion through samples, verified and measured here.

    Raises:
        InputError: samples that are no motion.
    """
    motion = samples.trajectory()
    report = verify(problem, motion)
    fits = motion.joint_names == problem.robot.joint_names
    bound = float(problem.lower_bounds([motion.end])[0]) if fits else None
    metrics = measure(problem, motion, report) if fits else None
    info = dict(row.info) | {"interpolation": samples.interpolation}
    run = Run(
        problem=problem,
        planner=EXTERNAL,
        options={},
        trajectory=motion,
        failure=None,
        report=report,
        lower_bound=bound,
        metrics=metrics,
        timings={"plan": math.nan},
        stages={},
        info=info,
    )
    digest, blob = hash_and_pack(motion)
    columns = result_columns(run, None) | {"plan_time": row.plan_time, "trajectory": digest}
    told = {"failure_kind": None, "failure_detail": None, "witness": None}
    return Outcome(replace(row, **told | columns), blob)


def _claimed_row(task: BenchTask, item: Mapping[str, Any]) -> Row:
    """Return the row of an entry's own numbers, planned and timed at most."""
    duration, seconds = _finite(item.get("motion_time")), _finite(item.get("solve_time"))
    turned = _finite(item.get("eef_orientation_path_length"))
    lengths = {
        "tool_path": _finite(item.get("eef_position_path_length")),
        "tool_rotation": None if turned is None else math.radians(turned),
    }
    good, found = bool(item.get("success")), not item.get("skip", False)
    why = failure(CLAIMED, "as its authors tell") if good else failure("failed", "by its authors' own account")
    row = Row(**empty_row(task), **why, planned=found, timed=found and duration is not None)
    info = jsonable({key: value for key, value in item.items() if key != "trajectory"})
    metrics = {name: value for name, value in lengths.items() if value is not None}
    return replace(row, plan_time=seconds, duration=duration, metrics=metrics, info=info)


def _store(beside: Store, folder: Path, planner: BenchPlanner, done: list[Outcome]) -> None:
    there = beside.meta("parts")
    used = dict.fromkeys(outcome.row.problem for outcome in done)
    problems = tuple(beside.problem(id_) for id_ in used)
    told = there | {
        "planners": {planner.label: [planner.name, dict(planner.options)]},
        "problems": {one.id: [one.hash, one.set_name, one.difficulty] for one in problems},
        "seeds": sorted({outcome.row.seed for outcome in done}),
        "repetitions": 1,
    }
    meta = {"name": planner.label, "suite": "", "suite_hash": "", "parts": told}
    with Store.filled(folder, meta) as store:
        store.fill(problems, (planner,))
        store.begin(EXTERNAL, {}, {})
        for outcome in done:
            store.add(outcome)
        store.end("complete")


def _finite(value: Any) -> float | None:
    return float(value) if isinstance(value, int | float) and abs(value) <= sys.float_info.max else None
