"""`RecordedMotion`: what was seen of a robot that moved, as a run folder."""

from typing import Any

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.problem.problem import Problem
from optiplan.records import dataclass
from optiplan.runs.run import versions
from optiplan.runs.run_folder import run_files
from optiplan.simulation.controllers.base import Command, JointTarget
from optiplan.simulation.execution_report import execution_report
from optiplan.simulation.log import LOG, Log, npz_of
from optiplan.simulation.recorder import Recorder
from optiplan.simulation.references.base import ToolTarget
from optiplan.trajectory.trajectory import Trajectory

STILL = np.zeros(6)


@dataclass(frozen=True, eq=False)
class RecordedMotion:
    """States of a robot, looked at now and then.

    Attributes:
        problem: in whose scene it moved.
        by: what moved it, in words.
        t: (K,), s, rising.
        q: (K, n) positions, rad or m; `v`: (K, n).
        wanted: (K, n) positions that were wanted.
        target: (K, 7) where the tool was wanted, position, m, and quaternion x, y, z, w; None: by the joints.
    """

    problem: Problem
    by: str
    t: Array
    q: Array
    v: Array
    wanted: Array
    target: Array | None = None

    def files(self) -> dict[str, bytes]:
        """Return the files of a run folder: `run.json`, `trajectory.json`, `log.npz`."""
        log = self._log()
        return {**run_files(_Recorded(self, log)), LOG: npz_of(log)}

    def _log(self) -> Log:
        robot, limits = self.problem.robot, self.problem.limits
        recorder = Recorder(robot, limits, len(self.t), float(np.diff(self.t).mean()), "velocity")
        none = np.zeros(robot.n)
        for k, (q, v, wanted) in enumerate(zip(self.q, self.v, self.wanted, strict=True)):
            target: JointTarget | ToolTarget = JointTarget(wanted, none, none, none)
            if self.target is not None:
                target = ToolTarget(pin.XYZQUATToSE3(self.target[k]), STILL, STILL)
            recorder.add(q, v, Command(none, wanted), none, target)
        recorder.end_block(self.t - self.t[0], None)
        return recorder.log({}, None)


class _Recorded:
    """A recording in the form in which runs are stored."""

    def __init__(self, recording: RecordedMotion, log: Log) -> None:
        self._recording, self._log = recording, log

    @property
    def trajectory(self) -> Trajectory:
        """The executed motion."""
        return self._log.trajectory

    def more_samples(self, rate: float) -> dict[str, Any]:
        """Return nothing: a log has its own samples."""
        return {}

    def to_dict(self) -> dict[str, Any]:
        """Content of `run.json`."""
        problem, log = self._recording.problem, self._log
        return {
            "name": problem.name,
            "hash": problem.hash,
            "problem": dict(problem.source),
            "planner": self._recording.by,
            "seed": problem.seed,
            "duration": float(log.t[-1]),
            "execution": log.summary(),
            "report": execution_report(log, problem.robot, problem.limits),
            "failure": None,
            "versions": versions(),
        }
