"""`Run`: the result of one planner on one problem."""

import platform
from collections.abc import Mapping
from dataclasses import field
from functools import cache
from html import escape
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

import optiplan
from optiplan._core import variant
from optiplan.errors import path_argument, wrong_argument
from optiplan.planners.base import Failure
from optiplan.problem.from_python import expression_names
from optiplan.problem.problem import Problem
from optiplan.records import dataclass
from optiplan.runs.metrics import Metrics
from optiplan.trajectory.segments import segment_data
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.report import Report
from optiplan.verify.verify import verify

if TYPE_CHECKING:
    from optiplan.runs.export import Exported
    from optiplan.verify.bounds.duration_bound import DurationBound

LIBRARIES = ("numpy", "scipy", "pin", "coal", "ompl", "piqp", "qpsolvers", "ruckig", "trimesh", "coacd")
"""Distributions whose version can change a result; recorded with every run."""

SMALLEST_BOUND = 1e-4
"""s: a lower bound below it is rounding of one configuration, not a way from one to another."""


@dataclass(frozen=True, eq=False, repr=False)
class Run:
    """Result of one planner on one problem.

    Attributes:
        planner: name in the registry.
        options: the options given; those at their defaults are omitted.
        trajectory: None when the planner failed.
        failure: why there is no trajectory; None when there is one.
        report: the verdict on the trajectory; None when there is none.
        lower_bound: s; no motion from the start to the end that was reached is shorter. None without a trajectory.
            Whether that is a bound of the whole problem, `lower_bound_of` says.
        metrics: metrics of the trajectory, verified or not; None without one that moves the robot's joints.
        timings: seconds of wall time: `plan`, `verify` (the proof of the trajectory), `other proofs` (of motions on the
            way, and of those refused) and `measure`; `robot`, what was proved once for the robot; `wish`, seeing to the
            wished clearance; `beyond the budget`.
        stages: seconds of wall time of the planner's own stages.
        info: the planner's record of its work, JSON-ready; `slowed`, the factor on the planner's duration that
            verification required, if any; `wish`, what became of `Problem.wished_clearance`: `clearance`, m, whether it
            is `kept`, and how much `longer` than the answer without it; `fault`, the `error` and `traceback` of a
            planner that failed after it had found a motion that was proved.
        improvements: (seconds of planning and proving, duration in s) of every verified motion on the way, each shorter
            than the last; but a motion that keeps the wished clearance may be longer by 2 %.
        proved_bound: of the duration of any motion of the problem, obstacles included; None: nobody asked.
        plan_cpu: seconds of processor time of planning alone, with that of processes that the planner waited for.
    """

    problem: Problem
    planner: str
    options: Mapping[str, Any]
    trajectory: Trajectory | None
    failure: Failure | None
    report: Report | None
    lower_bound: float | None
    metrics: Metrics | None
    timings: Mapping[str, float]
    stages: Mapping[str, float]
    info: Mapping[str, Any] = field(default_factory=dict)
    improvements: tuple[tuple[float, float], ...] = ()
    plan_cpu: float | None = None
    proved_bound: "DurationBound | None" = None

    @property
    def verified(self) -> bool:
        """Return whether the run has a trajectory whose report is verified."""
        return self.report is not None and self.report.verified

    @property
    def duration(self) -> float | None:
        """Duration of the motion, s."""
        return None if self.trajectory is None else self.trajectory.duration

    @property
    def lower_bound_of(self) -> str:
        """`problem`, if all its motions end in one configuration, so that none is shorter than the bound; else `end`.

        A motion to another end of the same goal may be shorter than the bound of this end. Of a task it is `stops`: the
        bound is that of the configurations in which this motion stands still.
        """
        if self.problem.task:
            return "stops"
        return "problem" if self.problem.one_end else "end"

    @property
    def ratio(self) -> float | None:
        """Duration / lower_bound, at least 1; None without a trajectory or when the robot need not move."""
        return share_of(self.duration, self.lower_bound)

    def save(self, folder: Path | str) -> None:
        """Write `run.json` and `trajectory.json` to a folder, both or none; an older run in it is replaced.

        Raises:
            InputError: the folder cannot be made or written.

        Example:
            >>> import optiplan as op
            >>> op.plan(op.load_problem("01_reach")).save("runs/reach")
        """
        from optiplan.runs.run_folder import save_run

        save_run(self, path_argument("Run.save", "folder", folder, "the path of a folder"))

    def export(
        self,
        path: Path | str,
        format: str | None = None,
        rate: float | None = None,
        *,
        cyclic: bool = False,
        unverified: bool = False,
    ) -> "Exported":
        """Write the motion for other programs.

        `csv` (t, q, v, a), `json` (polynomials and samples), `npz` (arrays), `ros` (a ROS 2 JointTrajectory message) or
        `urscript` (a program for a Universal Robots arm). `op.verify(problem, path)` reads the first two again.

        Args:
            path: the file; it is there whole or not at all.
            format: of the file; None: by its suffix (.csv, .json, .npz, .yaml, .script).
            rate: samples a second at least, Hz; None: 200, or 500 for `urscript`.
            cyclic: whether samples are exactly 1 / `rate` apart, as controllers with a fixed cycle want them; the
                motion is slowed down by less than one cycle so that it ends on one, and verified again, since slower
                can mean more torque. `urscript` always is.
            unverified: whether to write a motion that is not verified.

        Returns:
            What was written, and how far a reader deviates from the motion that puts straight lines, cubic or quintic
            polynomials between the samples.

        Raises:
            InputError: the run has no motion, or none that is verified, there is no such format, the robot does not fit
                it, the slower motion does not hold, there are too many samples, or the file cannot be written.

        Example:
            >>> import optiplan as op
            >>> op.plan(op.load_problem("01_reach")).export("reach.csv").errors["quintic"] < 1e-6
            True
        """
        if self.trajectory is None:
            raise wrong_argument("Run.export", "run", "a run without a motion", "one with a trajectory")
        if not (self.verified or unverified):
            expected = "one that is, or unverified=True"
            raise wrong_argument("Run.export", "run", f"a motion that is {self._verdict()}", expected)
        file = path_argument("Run.export", "path", path, "the path of a file")
        proof = (lambda slower: verify(self.problem, slower)) if not unverified else None
        from optiplan.runs.export import export_trajectory

        return export_trajectory(self.trajectory, file, format, rate, cyclic=cyclic, proof=proof)

    def __repr__(self) -> str:
        """Return the verdict, its scope and the ratio to the bound in one line."""
        return f"Run: {self._verdict()}; {self.problem.name}, {self.planner}"

    @property
    def why_not(self) -> str:
        """Why the run is not verified, in one line: its failure, or the first check that failed; empty if it is."""
        if self.failure is not None:
            return " ".join(f"{self.failure.kind}: {self.failure.detail}".split())
        refused = self.report.failures[:1] if self.report is not None else ()
        return "".join(f"{check.name}: {check.detail or check.place}" for check in refused)

    def _verdict(self) -> str:
        if self.trajectory is None:
            return f"no motion ({self.failure.kind}: {self.failure.detail})" if self.failure else "no motion"
        ratio = "" if self.ratio is None else f", {self.ratio:.3f} × the lower bound"
        refused = [] if self.report is None else [check.name for check in self.report.failures]
        words = "verified" if self.verified else f"not verified ({', '.join(refused) or 'nothing was checked'})"
        return f"{words}, {self.trajectory.duration:.3f} s{ratio}"

    def _repr_html_(self) -> str:
        """The verdict, the measures and the curves of the joints, for notebooks."""
        rows = {"problem": self.problem.name, "robot": self.problem.robot.name, "planner": self.planner}
        if self.metrics is not None:
            clearance = self.metrics.clearance
            rows["clearance"] = "" if clearance is None else f"{1e3 * clearance:.3g} mm, proved"
            for name, apart in (("scene", self.metrics.scene_clearance), ("itself", self.metrics.self_clearance)):
                rows[f"clearance from {name}"] = "" if apart is None else f"{1e3 * apart:.3g} mm, proved"
            rows["path of the tool"] = f"{self.metrics.tool_path:.3g} m"
        rows["time"] = ", ".join(f"{stage} {seconds:.3g} s" for stage, seconds in self.timings.items())
        cells = "".join(f"<tr><th>{key}</th><td>{escape(value)}</td></tr>" for key, value in rows.items() if value)
        curves = "" if self.trajectory is None else self.trajectory._repr_html_()
        return f"<p><b>{escape(self._verdict())}</b></p><table>{cells}</table>{curves}"

    def more_samples(self, rate: float) -> dict[str, Any]:
        """Return the rates of mecanum wheels, `wheels` (k, 4), rad/s, at the times of `trajectory.json`."""
        from optiplan.kinematics.mecanum import WHEELS, wheel_rates_along

        if self.trajectory is None or self.problem.robot.mecanum is None:
            return {}
        t = self.trajectory.sample_times(rate)
        rates = wheel_rates_along(self.problem.robot, self.trajectory(t), self.trajectory(t, 1))
        return {"wheel_names": list(WHEELS), "wheels": [] if rates is None else rates.tolist()}

    def to_dict(self) -> dict[str, Any]:
        """Return the content of `run.json`: everything but the motion, JSON-ready but for numpy numbers."""
        failure, unsaved = self.failure, expression_names(self.problem.path_constraints)
        return {
            "name": self.problem.name,
            "hash": self.problem.hash,
            "problem": dict(self.problem.source),
            "planner": self.planner,
            "options": dict(self.options),
            "seed": self.problem.seed,
            "verified": self.verified,
            "duration": self.duration,
            **(segment_data(self.trajectory.segments) if self.trajectory and self.trajectory.segments else {}),
            "lower_bound": self.lower_bound,
            "lower_bound_of": None if self.lower_bound is None else self.lower_bound_of,
            "ratio": self.ratio,
            **({} if self.proved_bound is None else {"proved_bound": self.proved_bound.to_dict()}),
            "tracking_error": self.problem.tracking_error.tolist(),
            "metrics": self.metrics and self.metrics.to_dict(),
            "failure": failure and {"kind": failure.kind, "detail": failure.detail, "witness": dict(failure.witness)},
            "report": self.report and self.report.to_dict(),
            "timings": {**self.timings, "plan_cpu": self.plan_cpu, "stages": dict(self.stages)},
            "geometry": dict(self.problem.robot.link_geometry),
            "over_cover": dict(self.problem.robot.over_cover),
            "notes": list(self.problem.robot.notes),
            "info": {**self.info, **({"expressions": unsaved} if unsaved else {})},
            "improvements": [list(improvement) for improvement in self.improvements],
            "versions": versions(),
            "core": variant,
        }


def share_of(duration: float | None, bound: float | None) -> float | None:
    """Duration / bound; None without either or when the robot need not move."""
    return None if duration is None or not bound or bound < SMALLEST_BOUND else duration / bound


def versions() -> dict[str, str]:
    """Versions of OptiPlan, Python and the libraries that can change a result."""
    return dict(_versions())


@cache
def _versions() -> dict[str, str]:
    """The same, looked up once: reading what pip knows takes milliseconds."""
    found = {"optiplan": optiplan.__version__, "python": platform.python_version()}
    for name in LIBRARIES:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:  # installed by other means than pip
            found[name] = "unknown"
    return found
