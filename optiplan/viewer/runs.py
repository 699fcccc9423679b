"""Data of one run for the page: sampled motion, verdict in words, and place of the failure."""

from collections.abc import Mapping, Sequence
from itertools import count
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array, is_finite
from optiplan.errors import InputError
from optiplan.kinematics.manipulability import ToolKinematics, ellipsoids, scaled
from optiplan.problem.problem import Problem
from optiplan.problem.seams.actions import SeamPath
from optiplan.robot.frames import frame_poses
from optiplan.runs.common_bound import duration_bound
from optiplan.runs.run import SMALLEST_BOUND, Run
from optiplan.trajectory.trajectory import Trajectory
from optiplan.viewer.goal_marks import targets
from optiplan.viewer.moving_objects import mounted_tools
from optiplan.viewer.run_data.attempts import found_by
from optiplan.viewer.run_data.checks import about, checks_of
from optiplan.viewer.run_data.clearance import clearance_of
from optiplan.viewer.run_data.closed_loop import Arrays, log_quantities
from optiplan.viewer.run_data.curves import curves_of, tool_frames, tool_points
from optiplan.viewer.surfaces import base64_of

RATE = 100.0  # samples of the motion a second
MAX_SAMPLES = 6000


class ViewedRun(NamedTuple):
    """One run to show; a plain tuple of the first three does as well.

    Attributes:
        label: name in the legend.
        trajectory: None when the planner failed.
        report: `Report.to_dict()`, or None when nothing was verified.
        failure: `kind`, `detail` and `witness` of a `Failure`, or None.
        record: `Run.to_dict()`, of which `metrics` and `timings` are shown; None when there is none.
        log: arrays of a closed loop (`closed_loop.read_log`); None for a motion that was planned.
        problem: its own, of the same robot; None: that of the page.
    """

    label: str
    trajectory: Trajectory | None
    report: Mapping[str, Any] | None = None
    failure: Mapping[str, Any] | None = None
    record: Mapping[str, Any] | None = None
    log: Arrays | None = None
    problem: Problem | None = None

    @classmethod
    def of(cls, run: Run, label: str = "") -> "ViewedRun":
        """Return a run of the page's problem, or of another with the same robot; by default with its planner's name."""
        record = run.to_dict()
        motion, problem = run.trajectory, run.problem
        return cls(label or run.planner, motion, record["report"], record["failure"], record, None, problem)


def distinct_labels(labels: Sequence[str], *details: Sequence[str]) -> list[str]:
    """Return labels of which no two are alike: those that are get the details that tell them apart, or numbers.

    Args:
        labels: k of them.
        details: k words each, the first tried first.
    """
    found = list(labels)
    for words in details:
        alike: dict[str, set[str]] = {}
        for label, word in zip(found, words, strict=True):
            alike.setdefault(label, set()).add(word)
        pairs = zip(found, words, strict=True)
        found = [f"{label} ({word})" if len(alike[label]) > 1 else label for label, word in pairs]
    taken, again = set(found), {label for label in found if found.count(label) > 1}
    for k, label in enumerate(found):
        if label in again:
            found[k] = next(name for n in count(1) if (name := f"{label} ({n})") not in taken)
            taken.add(found[k])
    return found


RunLike = ViewedRun | tuple[str, Trajectory | None, Mapping[str, Any] | None]


class Detail(NamedTuple):
    """How much of each run a page holds: the more runs, the less.

    Attributes:
        rate: samples of the poses a second; the page interpolates between them.
        samples: of the curves.
        distances: measured along the motion.
        ellipsoids: whether those of velocity and force are there.
        choices: whether the clearance of the scene, of the robot itself and of single pairs is there, each alone.
    """

    rate: float = RATE
    samples: int = 500
    distances: int = 160
    ellipsoids: bool = True
    choices: bool = True

    @classmethod
    def of(cls, motions: int) -> "Detail":
        """For a page with so many motions."""
        if motions <= 3:
            return cls(choices=motions <= 1)
        return cls(max(25.0, 3.0 * RATE / motions), max(40, 600 // motions), max(30, 400 // motions), False, False)


_WHOLE = Detail()


class Poses:
    """Poses of the joints and the tools of a robot, as the page stores them."""

    def __init__(self, problem: Problem) -> None:
        self._model = problem.robot.model
        self._data = self._model.createData()
        self._tool = self._model.getFrameId(problem.robot.tool_frame)
        self._kinematics = ToolKinematics(problem.robot)

    def of(self, Q: Array) -> tuple[Array, Array]:
        """Poses at configurations Q (k, n): joints (k, n, 7), position (m) and quaternion xyzw; tool points (k, 3)."""
        joints = np.empty((len(Q), self._model.njoints - 1, 7))
        tool = np.empty((len(Q), 3))
        for k, q in enumerate(Q):
            pin.framesForwardKinematics(self._model, self._data, q)
            joints[k] = [pin.SE3ToXYZQUAT(X) for X in list(self._data.oMi)[1:]]
            tool[k] = self._data.oMf[self._tool].translation
        return joints, tool

    def ellipsoids(self, Q: Array) -> Array:
        """Velocity ellipsoids of the tool point at configurations Q (k, n): (k, 7).

        A row holds the quaternion xyzw of the axes in the world and the semi-lengths (m/s for joint speeds of norm 1),
        longest first; those of the force ellipsoid are their reciprocals, on the same axes.
        """
        drawn = ellipsoids(scaled(self._kinematics.evaluate(Q)[1], "translation"))
        quaternions = np.array([pin.Quaternion(axes).coeffs() for axes in drawn.axes])
        return np.hstack([quaternions, drawn.velocity])


def run_for_page(problem: Problem, poses: Poses, run: ViewedRun, detail: Detail = _WHOLE) -> dict[str, Any]:
    """JSON-ready form of a run for the page."""
    shown: dict[str, Any] = {"label": run.label, "facts": [], "problems": [], "duration": 0.0}
    shown["badge"], shown["origin"] = _badge(run), _origin(problem, run)
    shown["segments"] = [] if run.trajectory is None else [one.to_data() for one in run.trajectory.segments]
    shown["stops"] = stops_told(run.record)
    shown["row"] = _row(run)
    failure, report = run.failure or {}, run.report or {}
    motion = motion_of(problem, run)
    shown["offending"] = run.trajectory is None and motion is not None
    shown["untimed"] = shown["offending"] and bool((failure.get("witness") or {}).get("untimed"))
    if motion is not None:
        shown |= _motion(problem, poses, motion, detail)
        shown["curves"] = curves_of(problem, motion, detail.samples)
        if run.log is not None:
            shown["curves"]["quantities"] += log_quantities(problem, run.log, 2 * detail.samples)
        shown["clearance"] = clearance_of(problem, motion, detail.distances, detail.choices)
    if run.trajectory is not None:
        shown["facts"] = _facts(problem, run.trajectory, run.report)
    shown["checks"], shown["about"] = checks_of(problem, report), about(problem, report) if report else None
    shown["found"] = found_by(run.record)
    if failure:
        shown["problems"].append(f"{failure.get('kind', 'failed')}: {failure.get('detail', '')}")
    refused = [check for check in report.get("checks", ()) if not check.get("passed")]
    shown["problems"] += [_words(check) for check in refused]
    shown["witnesses"] = [
        shown_witness
        for source in (failure, *refused)
        if (shown_witness := _witness(problem, poses, source)) is not None
    ]
    return shown


def motion_of(problem: Problem, run: ViewedRun) -> Trajectory | None:
    """The motion of a run, or that which its planner refused, where its failure holds one."""
    if run.trajectory is not None:
        return run.trajectory
    data = ((run.failure or {}).get("witness") or {}).get("motion")
    if not isinstance(data, Mapping):
        return None
    try:
        motion = Trajectory.from_dict(data)
    except InputError:
        return None
    return motion if motion.joint_names == problem.robot.joint_names else None


def _origin(problem: Problem, run: ViewedRun) -> list[str]:
    """What planned which robot's motion, from which seed, in words."""
    record = run.record or {}
    known = {key: record.get(key) for key in ("planner", "seed")}
    told = [f"{key} {value}" for key, value in known.items() if value is not None]
    return [f"robot {problem.robot.name}", *told]


def _row(run: ViewedRun) -> dict[str, float | None]:
    """What the command line's comparison shows of a run, None where it is not known; m, s, rad, N m."""
    record = run.record or {}
    metrics = record.get("metrics") or {}
    keys = ("tool_path", "peak_jerk", "jerk_share", "rms_torque", "scene_clearance", "self_clearance", "manipulability")
    row = {key: metrics.get(key) for key in keys}
    row["planning"] = (record.get("timings") or {}).get("plan")
    row["duration"] = None if run.trajectory is None else run.trajectory.duration
    return {key: float(value) if is_finite(value) else None for key, value in row.items()}


def _badge(run: ViewedRun) -> str:
    if run.trajectory is None:
        return "no plan"
    if run.report is None:
        return "not checked"
    if "executed" in run.report:
        return "executed" if run.report["executed"] is True else "executed, with contact"
    return "verified" if run.report.get("verified") is True else "not verified"


def _motion(problem: Problem, poses: Poses, trajectory: Trajectory, detail: Detail) -> dict[str, Any]:
    count = int(min(MAX_SAMPLES, max(2, np.ceil(trajectory.duration * detail.rate) + 1)))
    t = np.linspace(0.0, trajectory.duration, count)
    Q = trajectory(t)
    joints, tool = poses.of(Q)
    points = dict(tool_points(problem.robot, Q)) if len(tool_frames(problem.robot)) > 1 else {}
    changes = mounted_tools(problem, trajectory)
    for begin, frame in changes:  # one path, of the TCP that is mounted
        tool[t >= begin] = frame_poses(problem.robot, Q[t >= begin], frame)[:, :3, 3]
    changed = {one.name for one in problem.tools}
    others = [found for name, found in points.items() if name not in changed | {problem.robot.tool_frame}]
    return {
        "duration": trajectory.duration,
        "samples": count,
        "poses": base64_of(joints),
        "path": base64_of(tool),
        "cuts": [int(np.searchsorted(t, begin)) for begin, _ in changes if 0.0 < begin < trajectory.duration],
        "other_paths": [base64_of(points) for points in others],
        "ellipsoids": base64_of(poses.ellipsoids(Q)) if detail.ellipsoids else None,
    }


def _facts(problem: Problem, trajectory: Trajectory, report: Mapping[str, Any] | None) -> list[tuple[str, str]]:
    bound = duration_bound(problem, trajectory)
    facts = [("duration", f"{trajectory.duration:.3f} s")]
    led = any(isinstance(step.action, SeamPath) for step in problem.task)  # at a stated speed, which no bound knows
    if bound >= SMALLEST_BOUND and not led:
        whole = "× bound of its stops" if problem.task else "× bound of this end configuration"
        name = "× lower bound" if problem.one_end else whole
        facts.append((name, f"{trajectory.duration / bound:.3f}"))
    for check in (report or {}).get("checks", ()):
        if check.get("name") == "collision":
            witness = check.get("witness") or {}
            named = (
                ("clearance, proved", "proved_clearance"),
                ("clearance from the scene, proved", "scene_clearance"),
                ("clearance of the robot from itself, proved", "self_clearance"),
                ("smallest distance met", "met_clearance"),
            )
            facts += [(name, f"{1e3 * witness[key]:.2f} mm") for name, key in named if witness.get(key) is not None]
            if required := witness.get("required"):
                scene, own = 1e3 * required["scene"], 1e3 * required["self"]
                groups = ", groups of pairs as stated" if required["pairs"] else ""
                facts.append(("clearance required", f"{scene:g} mm from the scene, {own:g} mm from itself{groups}"))
    return facts


def _words(check: Mapping[str, Any]) -> str:
    detail = check.get("detail") or check.get("place") or "refused"
    when = "" if check.get("time") is None else f" (at {check['time']:.3f} s)"
    return f"{check.get('name')}: {detail}{when}"


def _witness(problem: Problem, poses: Poses, source: Mapping[str, Any]) -> dict[str, Any] | None:
    """Return the place of a failure: the configuration, the nearest points of the two bodies (m), and their names.

    Of a goal that cannot be reached, `gap` leads from where the tool comes to where it should be, m.
    """
    n = problem.robot.n
    witness = source.get("witness") or {}
    q, points = witness.get("q"), _points(witness.get("points"))
    if q is None and not points:
        return None
    shown: dict[str, Any] = {"points": points, "pair": [str(name) for name in witness.get("pair") or ()]}
    distance = witness.get("distance", witness.get("met_clearance"))
    shown["distance"] = None if distance is None else float(distance)
    time = witness.get("t", source.get("time"))
    if time is not None:
        shown["time"] = float(time)
    if q is not None and np.shape(q) == (n,) and np.all(np.isfinite(np.asarray(q, dtype=float))):
        joints, tool = poses.of(np.asarray([q], dtype=float))
        shown["poses"] = base64_of(joints)
        wanted = [np.asarray(pose[:3]) for pose in targets(problem)]
        if witness.get("position_error") is not None and wanted:
            nearest = min(wanted, key=lambda point: float(np.linalg.norm(point - tool[0])))
            shown["gap"] = [tool[0].tolist(), nearest.tolist()]
    return shown


def _points(points: Sequence[Any] | None) -> list[list[float]]:
    if points is None:
        return []
    array = np.asarray(points, dtype=float)
    return [] if array.size == 0 or array.size % 3 else array.reshape(-1, 3).tolist()


def stops_told(record: Mapping[str, Any] | None) -> list[dict[str, Any]]:
    """Return the stops that a record (`run.json`) tells of: `t`, s, the step that each comes `after`, and `why`."""
    told = ((record or {}).get("info") or {}).get("stops")
    stops = [one for one in told if isinstance(one, Mapping)] if isinstance(told, list | tuple) else []
    return [
        {"t": float(one["t"]), "after": int(one["after"]), "why": str(one.get("why", ""))}
        for one in stops
        if is_finite(one.get("t")) and is_finite(one.get("after"))
    ]
