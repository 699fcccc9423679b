"""One problem file planned and verified, as a row of plain data: what a worker of a batch makes."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import field
from pathlib import Path
from typing import Any

import numpy as np

from optiplan.errors import InputError, OptiPlanError
from optiplan.files import read_bytes
from optiplan.planners.base import Budget, silent
from optiplan.problem.load import load_problem
from optiplan.records import dataclass
from optiplan.runs.pipeline import answer, chosen, plan_and_verify_once
from optiplan.runs.run import Run
from optiplan.runs.run_folder import TRAJECTORY, motion_file
from optiplan.verify.report import jsonable

VERIFIED, UNVERIFIED, NO_PLAN, BAD_INPUT, CRASHED = "verified", "unverified", "no-plan", "bad-input", "crashed"
STATES = (VERIFIED, UNVERIFIED, NO_PLAN, BAD_INPUT, CRASHED)
"""What became of an episode; `crashed`: an unexpected exception, or a worker that died twice, the second time alone."""
ANSWERS = (VERIFIED, UNVERIFIED, NO_PLAN)
"""What an episode is planned once for; causes of the others may be gone by the next call."""


@dataclass(frozen=True)
class EpisodeRequest:
    """One problem file to plan.

    Attributes:
        root: the folder of the batch.
        file: the problem file, relative to it.
        seed: in the place of the file's; None: the file's own.
        planner: in the place of the file's; None: the file's own.
        options: of that planner; None: the problem's own, where the planner is its own.
        seconds: of wall time for planning and proof.
        rate: of the samples, Hz.
    """

    root: Path
    file: str
    seed: int | None
    planner: str | None
    options: Mapping[str, Any] | None
    seconds: float
    rate: float


@dataclass(frozen=True)
class Episode:
    """The row of one problem file; columns of Parquet are these, in this order.

    Attributes:
        file: relative to the folder of the batch.
        file_digest: SHA-256 of the file's bytes.
        wanted_seed: that the batch requests, -1 for the file's own.
        state: of `STATES`.
        detail: why it is not verified; of a bad file the file, line and field.
        name, hash, seed, robot, planner: of the problem; the hash covers robot and meshes.
        task: the folder of the file, or the file's name.
        joints: names of the planned joints, n.
        duration, lower_bound, plan_seconds, verify_seconds: s; NaN where there is none.
        versions: of OptiPlan, Python and the libraries, JSON.
        report: the verdict with every check, JSON.
        trajectory: the motion in pieces, as `trajectory.json`; `op.verify` proves it again.
        rate: of the samples, Hz.
        positions, velocities, accelerations: at k / rate, the last ones at the end: rows of n, rad or m and seconds.
    """

    file: str
    file_digest: str
    wanted_seed: int
    state: str
    detail: str = ""
    name: str = ""
    hash: str = ""
    seed: int = 0
    robot: str = ""
    planner: str = ""
    task: str = ""
    joints: tuple[str, ...] = ()
    duration: float = float("nan")
    lower_bound: float = float("nan")
    plan_seconds: float = float("nan")
    verify_seconds: float = float("nan")
    versions: str = ""
    report: str = ""
    trajectory: bytes = b""
    rate: float = float("nan")
    positions: np.ndarray[Any, Any] = field(default_factory=lambda: np.empty(0, np.float32))
    velocities: np.ndarray[Any, Any] = field(default_factory=lambda: np.empty(0, np.float32))
    accelerations: np.ndarray[Any, Any] = field(default_factory=lambda: np.empty(0, np.float32))


def digest_of(path: Path) -> str:
    """SHA-256 of a file's bytes; empty where it cannot be read."""
    try:
        return hashlib.sha256(read_bytes(path)).hexdigest()
    except OSError:
        return ""


def planned_episode(request: EpisodeRequest) -> Episode:
    """Plan and verify one problem file; whatever is wrong with it becomes its row."""
    path = request.root / request.file
    seed = -1 if request.seed is None else request.seed
    start: dict[str, Any] = {"file": request.file, "file_digest": digest_of(path), "wanted_seed": seed}
    task = Path(request.file).parent.name or Path(request.file).stem
    try:
        problem = load_problem(path) if request.seed is None else load_problem(path, seed=request.seed)
        name, options = chosen(problem, request.planner, request.options)
        run = plan_and_verify_once(problem, name, options, Budget(request.seconds), silent, by=answer)
        return Episode(**start, **_content(run, request.rate), task=task)
    except InputError as error:
        return Episode(**start, state=BAD_INPUT, detail=str(error), task=task)
    except OptiPlanError as error:
        return Episode(**start, state=BAD_INPUT, detail=f"{path}: {error}", task=task)
    except Exception as error:  # ends no other
        return Episode(**start, state=CRASHED, detail=f"{path}: {type(error).__name__}: {error}", task=task)


def _content(run: Run, rate: float) -> dict[str, Any]:
    problem, motion = run.problem, run.trajectory
    said = "" if run.failure is None else f"{run.failure.kind}: {run.failure.detail}"
    if motion is not None and not run.verified and run.report is not None:
        failed = [check for check in run.report.checks if not check.passed]
        said = "; ".join(f"{check.name} of {check.place}" for check in failed) or "not verified"
    record = run.to_dict()
    data = {
        "state": VERIFIED if run.verified else NO_PLAN if motion is None else UNVERIFIED,
        "detail": said,
        "name": problem.name,
        "hash": problem.hash,
        "seed": problem.seed,
        "robot": problem.robot.name,
        "planner": run.planner,
        "joints": tuple(problem.robot.joint_names),
        "plan_seconds": float(run.timings.get("plan", np.nan)),
        "verify_seconds": float(run.timings.get("verify", np.nan)),
        "versions": json.dumps(record["versions"]),
        "report": json.dumps(jsonable(record["report"]), allow_nan=False),
        "rate": rate,
    }
    if motion is not None:
        times = np.minimum(np.arange(np.ceil(motion.duration * rate) + 1) / rate, motion.duration)
        data |= {
            "duration": float(motion.duration),
            "lower_bound": np.nan if run.lower_bound is None else float(run.lower_bound),
            "trajectory": motion_file(run, None)[TRAJECTORY],
            **{
                key: np.asarray(motion(times, order), np.float32).ravel()
                for order, key in enumerate(("positions", "velocities", "accelerations"))
            },
        }
    return data
