"""`Simulation`: a control file that was run, and its log."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from optiplan.errors import path_argument
from optiplan.planners.base import Failure
from optiplan.records import dataclass
from optiplan.runs.run import versions
from optiplan.runs.run_folder import save_run
from optiplan.simulation.closed_loop import simulate
from optiplan.simulation.execution_report import execution_report
from optiplan.simulation.files.build import build_loop
from optiplan.simulation.files.read import ControlFile, read_control
from optiplan.simulation.files.schema import StepSpec
from optiplan.simulation.log import LOG, Log, npz_of
from optiplan.simulation.step_response import StepResponse, step_response
from optiplan.trajectory.trajectory import Trajectory


@dataclass(frozen=True, eq=False, repr=False)
class Simulation:
    """A closed loop that was run from a control file.

    Attributes:
        control: the file.
        log: what happened; None where the reference was to be planned and no motion was found.
        failure: why there is no log; None where there is one.
    """

    control: ControlFile
    log: Log | None
    failure: Failure | None = None

    @property
    def clean(self) -> bool:
        """Whether it ran to its end without contact."""
        return self.log is not None and not self.log.touched and not self.log.stopped

    @property
    def trajectory(self) -> Trajectory | None:
        """The executed motion."""
        return None if self.log is None else self.log.trajectory

    @property
    def responses(self) -> Mapping[str, StepResponse]:
        """Step responses by joint; empty where the reference is no step, or less than two samples follow it."""
        spec = self.control.spec.reference.value
        if not isinstance(spec, StepSpec) or self.log is None or (self.log.t >= spec.at).sum() < 2:
            return {}
        start, end = self.control.problem.start, self.log.wanted[-1]
        return {
            name: step_response(self.log.t, self.log.q[:, j], spec.at, float(start[j]), float(end[j]))
            for j, name in enumerate(self.log.joint_names)
            if start[j] != end[j]
        }

    def more_samples(self, rate: float) -> dict[str, Any]:
        """Return nothing: a log has its own samples."""
        return {}

    def to_dict(self) -> dict[str, Any]:
        """Content of `run.json`: everything but the arrays over time."""
        control, log, failure = self.control, self.log, self.failure
        return {
            "name": control.name,
            "hash": control.problem.hash,
            "problem": dict(control.problem.source),
            "planner": f"{control.spec.controller.kind} ({control.spec.plant.engine})",
            "seed": control.spec.seed,
            "clean": self.clean,
            "duration": None if log is None else float(log.t[-1]),
            "control": control.document.data,
            "execution": None if log is None else log.summary(),
            "report": None if log is None else execution_report(log, control.robot, control.problem.limits),
            "step_response": {name: vars(found) for name, found in self.responses.items()},
            "failure": failure and {"kind": failure.kind, "detail": failure.detail, "witness": dict(failure.witness)},
            "versions": versions(),
        }

    def save(self, folder: Path | str) -> None:
        """Write the log folder: `run.json`, `trajectory.json` (the executed motion), `log.npz` and pictures.

        Raises:
            InputError: the folder cannot be made or written.
        """
        where = path_argument("Simulation.save", "folder", folder, "the path of a folder")
        from optiplan.simulation.pictures import PICTURES, pictures

        files = {}
        if self.log is not None:
            files = {LOG: npz_of(self.log), **pictures(self.log, self.control.problem.limits)}
        save_run(self, where, files, (LOG, *PICTURES))

    def __repr__(self) -> str:
        """Name and what came of it."""
        came = f"no motion ({self.failure.detail})" if self.failure is not None else repr(self.log)
        return f"Simulation: {self.control.name}; {came}"


def run_control(
    source: Path | str | Mapping[str, Any] | ControlFile, progress: Callable[[float], None] | None = None
) -> Simulation:
    """Read a control file, build its loop and run it.

    Args:
        source: the file, a mapping of its keys, or one that was read.
        progress: called with the fraction done, 0 to 1.

    Raises:
        InputError: everything that is wrong with the file.
    """
    control = source if isinstance(source, ControlFile) else read_control(source)
    loop = build_loop(control)
    if isinstance(loop, Failure):
        return Simulation(control, None, loop)
    return Simulation(control, simulate(loop, progress))
