"""The reference that a control file states."""

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.config.simple_yaml import Place
from optiplan.errors import InputError, Issue, OptiPlanError
from optiplan.files import read_bytes
from optiplan.geometry.poses import pose_from_data
from optiplan.planners.base import Budget, Failure
from optiplan.planners.cartesian.tool_path import ToolPath, arc, circle, circle_through, line, screw, screw_about
from optiplan.robot.frames import frame_pose
from optiplan.runs import pipeline
from optiplan.runs.run_folder import load_run
from optiplan.simulation.files.read import ControlFile
from optiplan.simulation.files.schema import (
    ArcSpec,
    CircleSpec,
    EndSpec,
    LineSpec,
    MovingSpec,
    PlanSpec,
    RecordedSpec,
    ScrewSpec,
    StepSpec,
)
from optiplan.simulation.references.base import Reference
from optiplan.simulation.references.joints import StepReference, TrajectoryReference
from optiplan.simulation.references.tool import MovingTarget, PathReference, RecordedPath
from optiplan.trajectory.sample_file import csv_rows

COLUMNS = ("t", "x", "y", "z", "qx", "qy", "qz", "qw")
"""Of a recorded path."""

_AT_START = 1e-3
"""rad or m: farther from the problem's start a trajectory does not begin there."""


def reference_of(control: ControlFile) -> Reference | Failure:
    """The reference; a `Failure` where a planner was to find it and did not.

    Raises:
        InputError: a file of it cannot be used, or it does not begin where the robot stands.
    """
    match control.spec.reference.value:
        case PlanSpec() as spec:
            return _planned(control, spec)
        case str() as place:
            return _stored(control, place)
        case StepSpec() as spec:
            return _step(control, spec)
        case MovingSpec() as spec:
            rates = (np.array(spec.amplitude), np.array(spec.frequency))
            frame = control.frame(spec.frame)
            return MovingTarget(frame, _start(control, frame), *rates, spec.lasting, np.array(spec.phase))
        case RecordedSpec() as spec:
            return _recorded(control, spec)
        case spec:
            frame = control.frame(spec.frame)
            return PathReference(frame, _path(control, spec, _start(control, frame)), spec.duration)


def _planned(control: ControlFile, spec: PlanSpec) -> Reference | Failure:
    problem = control.problem.with_seed(control.spec.seed) if control.spec.seed else control.problem
    if control.spec.problem is None:
        raise control.issue(("reference", "plan"), "plan without a problem", "`problem`, which says where to go")
    name, options = pipeline.chosen(problem, spec.planner, spec.options)
    try:
        run = pipeline.run(problem, name, options, Budget(spec.budget), lambda stage, share: None)
    except InputError:
        raise
    except OptiPlanError as error:
        raise control.issue(("reference", "plan"), str(error), "a planner and its options") from None
    if run.trajectory is None:
        return run.failure or Failure("no-path", "the planner gave no reason", {})
    return TrajectoryReference(run.trajectory)


def _stored(control: ControlFile, name: str) -> Reference:
    place: Place = ("reference", "trajectory")
    file = control.base / name
    if not file.exists():
        raise control.issue(place, f"'{name}', but there is no {file}", "a run folder, trajectory.json or CSV")
    stored = load_run(file, control.robot.joint_names)
    if stored.trajectory is None:
        raise control.issue(place, f"'{name}', a run without a motion", "a run with a trajectory")
    motion, names = stored.trajectory, control.robot.joint_names
    if motion.joint_names != names:
        raise control.issue(place, f"a motion of {', '.join(motion.joint_names)}", f"one of {', '.join(names)}")
    away = float(np.abs(motion.start - control.problem.start).max())
    if away > _AT_START:
        found = f"a motion that begins {away:.3g} rad or m from the start"
        raise control.issue(place, found, f"one that begins at {np.round(control.problem.start, 6).tolist()}")
    return TrajectoryReference(motion)


def _step(control: ControlFile, spec: StepSpec) -> StepReference:
    start = control.problem.start
    end = np.array(start)
    if isinstance(spec.to, dict):
        end = np.array([spec.to[joint] for joint in control.robot.joint_names], float)
    elif spec.to is not None:
        end = np.array(spec.to, float)
    elif spec.joint is not None and spec.by is not None:
        end[control.robot.joint_names.index(spec.joint)] += spec.by
    limits = control.robot.limits
    outside = np.flatnonzero(limits.outside(end))
    if len(outside):
        j = int(outside[0])
        found = f"{control.robot.joint_names[j]} = {end[j]:.6g}, outside its limits"
        raise control.issue(("reference", "step"), found, f"a value in [{limits.lower[j]:.6g}, {limits.upper[j]:.6g}]")
    return StepReference(start, end, spec.at, spec.at + spec.lasting)


def _path(control: ControlFile, spec: LineSpec | ArcSpec | CircleSpec | ScrewSpec, start: pin.SE3) -> ToolPath:
    match spec:
        case LineSpec(to=None, by=by):
            return line(start, pin.SE3(start.rotation, start.translation + np.array(by)))
        case LineSpec(to=to):
            return line(start, _end(to, start))
        case ArcSpec(through=through, to=to):
            end = _end(to, start)
            found = circle_through(start.translation, np.array(through), end.translation)
            if found is None:
                place = ("reference", "arc", "through")
                raise control.issue(place, f"{list(through)}, in line with start and end", "a point beside that line")
            return arc(start, end, *found)
        case CircleSpec():
            normal = np.array(spec.normal) / np.linalg.norm(spec.normal)
            turning = 2.0 * np.pi * spec.turns * normal
            following = spec.orientation == "following"
            return circle(start, np.array(spec.centre), turning, turning if following else np.zeros(3))
        case ScrewSpec(to=None):
            axis = np.array(spec.axis) / np.linalg.norm(spec.axis or ())
            return screw_about(start, axis, np.array(spec.point), spec.angle, spec.slide)
        case ScrewSpec(to=to):
            return screw(start, _end(to, start))


def _end(spec: EndSpec | None, start: pin.SE3) -> pin.SE3:
    assert spec is not None
    X = pose_from_data({"position": spec.position, "rpy": spec.rpy, "quaternion": spec.quaternion})
    kept = spec.rpy is None and spec.quaternion is None
    return pin.SE3(start.rotation if kept else X.rotation, X.translation)


def _start(control: ControlFile, frame: str) -> pin.SE3:
    return frame_pose(control.robot, control.problem.start, frame)


def _recorded(control: ControlFile, spec: RecordedSpec) -> RecordedPath:
    place: Place = ("reference", "recorded", "file")
    file = control.base / spec.file
    try:
        text = read_bytes(file).decode("utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "not UTF-8 text"
        raise control.issue(place, f"'{spec.file}' ({reason.lower()})", "a CSV file that can be read") from None
    lines, rows = _numbers(text, str(file))
    t, positions, quaternions = rows[:, 0], rows[:, 1:4], rows[:, 4:]
    norms = np.linalg.norm(quaternions, axis=1)
    if (np.abs(norms - 1.0) > 1e-3).any():
        k = int(np.abs(norms - 1.0).argmax())
        raise InputError([Issue(str(file), lines[k], "qx … qw", f"length {norms[k]:.6g}", "a unit quaternion")])
    if len(t) < 2 or not (np.diff(t) > 0.0).all():
        at = None if len(t) < 2 else lines[int(np.argmin(np.diff(t))) + 1]
        raise InputError([Issue(str(file), at, "t", "times that do not increase", "two increasing times or more")])
    return RecordedPath(control.frame(spec.frame), t, positions, quaternions / norms[:, None])


def _numbers(text: str, file: str) -> tuple[list[int], Array]:
    """The lines (K,) of a CSV file with the columns `COLUMNS`, and their numbers (K, 8)."""
    stated = csv_rows(text, file)
    line, names = stated[0] if stated else (1, [])
    header = tuple(name.strip() for name in names)
    if header != COLUMNS:
        raise InputError([Issue(file, line, "columns", ", ".join(header)[:120] or "nothing", ", ".join(COLUMNS))])
    rows = []
    for at, cells in stated[1:]:
        try:
            row = [float(value) for value in cells]
        except ValueError:
            row = []
        if len(row) != len(COLUMNS) or not np.isfinite(row).all():
            raise InputError([Issue(file, at, "row", f"{','.join(cells)[:80]!r}", f"{len(COLUMNS)} finite numbers")])
        rows.append(row)
    return [at for at, _ in stated[1:]], np.array(rows, float).reshape(-1, len(COLUMNS))
