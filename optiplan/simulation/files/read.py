"""Read a control file: its problem, checked as problems are, and what its other parts say of that robot."""

import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from optiplan.arrays import Array
from optiplan.config.document import Document, plain, read_yaml, validate
from optiplan.config.messages import choices
from optiplan.config.simple_yaml import Place
from optiplan.errors import InputError, Issue, OptiPlanError
from optiplan.files import is_folder, reading
from optiplan.problem.examples import find_problem
from optiplan.problem.from_data import read_problem
from optiplan.problem.load import load_problem
from optiplan.problem.problem import Problem
from optiplan.records import dataclass
from optiplan.resources import control_dir
from optiplan.robot.frames import frame_names
from optiplan.robot.given_configurations import wrong_names
from optiplan.robot.robot import Robot
from optiplan.simulation.closed_loop import OF_TASKS
from optiplan.simulation.files.schema import OF_PROBLEM, ControlSpec
from optiplan.simulation.plants.dynamics import check_inertias

_PSEUDO = "<control>"
_TOOL = ("line", "arc", "circle", "screw", "moving", "recorded")
"""References of the tool."""
_GAINS = {
    "pid": ("p", "i", "d", "integral_limit"),
    "drive": ("position", "velocity", "integral", "integral_limit"),
}
"""Controllers with values for each joint."""
_DYNAMICS: tuple[Place, ...] = (
    ("plant", "friction"),
    ("plant", "rotor_inertia"),
    ("plant", "payload"),
    ("disturbances",),
)
"""Keys for plants that take torques."""
_FOLLOWING: tuple[Place, ...] = (("controller", "task_space", "frequency"), ("controller", "task_space", "damping"))
"""Keys of the computed torque by which a robot follows the steps of the task-space controller."""
_COSTS: tuple[Place, ...] = tuple(
    ("controller", "task_space", f"{name}_cost") for name in ("position", "orientation", "posture")
)
"""Keys that weigh the tool's pose against the joints."""


@dataclass(frozen=True, eq=False, repr=False)
class ControlFile:
    """A control file that was read and checked.

    Attributes:
        name: of the loop.
        problem: robot, start, scene and limits; its goal is the start where the file gives no problem.
        spec: what the file says.
        base: folder that file names are relative to.
        document: the file, for messages with lines.
    """

    name: str
    problem: Problem
    spec: ControlSpec
    base: Path
    document: Document

    @property
    def robot(self) -> Robot:
        """The robot."""
        return self.problem.robot

    def per_joint(self, value: float | tuple[float, ...]) -> Array:
        """A value for all joints or for each, as (n,)."""
        return np.broadcast_to(np.asarray(value, float), (self.robot.n,)).copy()

    def frame(self, name: str | None) -> str:
        """The frame that is meant."""
        return self.robot.tool_frame if name is None else name

    def issue(self, place: Place, found: str, expected: str) -> InputError:
        """The error about one value of the file."""
        return InputError([self.document.issue(place, found, expected)])

    def __repr__(self) -> str:
        """Name, reference, controller and plant."""
        spec = self.spec
        return f"ControlFile: {self.name}, {spec.reference.kind}, {spec.controller.kind}, engine {spec.plant.engine}"


def find_control(name: str) -> Path:
    """Find the file of `name`: a path that exists, else `delbot_circle`, `delbot_circle.yaml` or `control/…`.

    Raises:
        InputError: no such file, with the examples.
    """
    path = Path(name)
    if os.path.isfile(path):  # which raises nothing, however long the name is
        return path
    examples = {example.stem: example for example in sorted(control_dir().glob("*.yaml"))}
    if path.parent in (Path(), Path("control")) and path.suffix in ("", ".yaml") and path.stem in examples:
        return examples[path.stem]
    found = "is a folder" if is_folder(path) else "no such file" if name else "an empty name"
    expected = f"a control file, or an example, {choices(path.stem, list(examples))}"
    raise InputError([Issue(name or "''", None, "file", found, expected)])


def read_control(source: Path | str | Mapping[str, Any]) -> ControlFile:
    """Read a control file, or a mapping of its keys.

    Raises:
        InputError: it cannot be used; holds every issue found in its keys.
    """
    with reading(None):
        if isinstance(source, Mapping):
            document, base = Document(Path(_PSEUDO), plain(source), {}), Path.cwd()
        else:
            document, base = read_yaml(source), Path(source).resolve().parent
        spec = validate(ControlSpec, document)
        problem = _problem(spec, document, base)
    name = spec.name or (document.path.stem if document.path.name != _PSEUDO else "control")
    control = ControlFile(name, problem, spec, base, document)
    issues = [*_sizes(control), *_fits(control), *_timing(control)]
    if issues:
        raise InputError(sorted(issues, key=lambda issue: issue.line or 0))
    return control


def _problem(spec: ControlSpec, document: Document, base: Path) -> Problem:
    if spec.problem is not None:
        beside = base / spec.problem
        try:
            problem = load_problem(beside if beside.is_file() else find_problem(spec.problem))
        except InputError as error:
            missing = [issue for issue in error.issues if issue.file == spec.problem and issue.line is None]
            if not missing:
                raise
            raise InputError([document.issue(("problem",), f"'{spec.problem}'", missing[0].expected)]) from None
        if problem.task:
            found, expected = OF_TASKS
            raise InputError([document.issue(("problem",), f"'{spec.problem}', {found}", expected)])
        return problem
    data = {key: document.data[key] for key in OF_PROBLEM if key in document.data}
    data |= {"version": 1, "name": spec.name or document.path.stem.strip("<>"), "goal": data["start"]}
    try:
        return Problem.of(read_problem(replace(document, data=data), base))
    except InputError as error:
        own = [issue for issue in error.issues if issue.path[:1] != ("goal",)]
        raise InputError(own or error.issues) from None


def _sizes(control: ControlFile) -> list[Issue]:
    """Lists of values a joint that are not of n values."""
    n, spec, issues = control.robot.n, control.spec, []
    listed: dict[Place, Any] = {}
    for kind, keys in _GAINS.items():
        gains = getattr(spec.controller, kind)
        listed |= {("controller", kind, key): getattr(gains, key, None) for key in keys}
    friction = spec.plant.friction
    listed |= {("plant", "friction", key): getattr(friction, key) for key in ("viscous", "coulomb")}
    listed["plant", "rotor_inertia"] = spec.plant.rotor_inertia
    step = spec.reference.step
    if step is not None:
        listed["reference", "step", "to"] = step.to
    for place, value in listed.items():
        if isinstance(value, tuple) and len(value) != n:
            names = ", ".join(control.robot.joint_names)
            issues.append(control.document.issue(place, f"{len(value)} values", f"{n} values, one for each of {names}"))
    if step is not None and isinstance(step.to, dict):
        place = ("reference", "step", "to")
        for joint, found, expected in wrong_names(control.robot.joint_names, step.to):
            issues.append(control.document.issue(place if joint is None else (*place, joint), found, expected))
    if step is not None and step.joint is not None and step.joint not in control.robot.joint_names:
        expected = choices(step.joint, control.robot.joint_names)
        place = ("reference", "step", "joint")
        issues.append(control.document.issue(place, f"unknown joint '{step.joint}'", expected))
    frame = getattr(spec.reference.value, "frame", None)
    if frame is not None and frame not in frame_names(control.robot.model):
        place = ("reference", spec.reference.kind, "frame")
        expected = choices(frame, sorted(frame_names(control.robot.model)))
        issues.append(control.document.issue(place, f"unknown frame '{frame}'", expected))
    return issues


def _fits(control: ControlFile) -> list[Issue]:
    """Parts that do not go together: reference and controller, controller and plant, plant and robot."""
    spec, document, issues = control.spec, control.document, []
    controller, engine, reference = spec.controller.kind, spec.plant.engine, spec.reference.kind
    if reference in _TOOL and controller != "task_space":
        found = f"{controller}, which moves joints, with the reference '{reference}', which is of the tool"
        expected = "controller: task_space; or a reference of the joints: plan, trajectory, step"
        issues.append(document.issue(("controller", controller), found, expected))
    if engine == "ideal" and controller in ("pid", "drive", "computed_torque"):
        found = f"{controller}, which gives torques, with engine: ideal, which takes velocities"
        expected = "engine: own or mujoco; or controller: velocity, task_space"
        issues.append(document.issue(("controller", controller), found, expected))
    if engine != "ideal" and controller == "velocity":
        found = f"velocity, which gives velocities, with engine: {engine}, which takes torques"
        issues.append(document.issue(("controller", controller), found, "engine: ideal; or another controller"))
    turning, task_space = control.problem.scene.turning_obstacles, spec.controller.task_space
    if turning and task_space is not None and task_space.clearance is not None:
        found = f"'{turning[0].name}', which turns, with controller: task_space, which keeps clear of what slides"
        place: Place = ("scene",) if spec.problem is None else ("problem",)
        issues.append(document.issue(place, found, "obstacles that slide; or clearance: null of the controller"))
    if engine != "ideal":
        issues += _dynamics(control)
    return [*issues, *_without_effect(control)]


def _without_effect(control: ControlFile) -> list[Issue]:
    """Keys that would be ignored beside others; their defaults may stand there, as in files that hold every key."""
    spec, ignored = control.spec, dict[Place, str]()
    task_space, reference = spec.controller.task_space, spec.reference.kind
    if task_space is not None and task_space.feedback == "measured":
        ignored |= dict.fromkeys(_FOLLOWING, "feedback: measured, whose accelerations become torques as they are")
    if not spec.plant.encoder:
        ignored["plant", "velocity_filter"] = "encoder: 0, with which velocities are measured as they are"
    if spec.plant.engine == "ideal":
        ignored |= dict.fromkeys((*_DYNAMICS, *_FOLLOWING), "engine: ideal, which follows every command exactly")
    if reference not in _TOOL:
        ignored |= dict.fromkeys(_COSTS, f"the reference '{reference}', which is of the joints")
    return [
        control.document.issue(place, f"a key without effect beside {beside}", "no such key")
        for place, beside in ignored.items()
        if _changed(spec, place)
    ]


def _changed(spec: ControlSpec, place: Place) -> bool:
    """Whether a value is another than it is without the key."""
    owner: Any = spec
    *parents, key = map(str, place)
    for parent in parents:
        owner = getattr(owner, parent)
    return owner is not None and bool(getattr(owner, key) != type(owner).model_fields[key].default)


def _dynamics(control: ControlFile) -> list[Issue]:
    document = control.document
    place: Place = ("robot",) if control.spec.problem is None else ("problem",)
    try:
        check_inertias(control.robot)
    except InputError as error:
        return [document.issue(place, issue.found, issue.expected) for issue in error.issues]
    if control.spec.plant.engine == "mujoco":
        from optiplan.simulation.plants.mujoco_plant import mujoco_module

        try:
            mujoco_module()
        except OptiPlanError as error:
            return [document.issue(("plant", "engine"), str(error), "own, or MuJoCo installed")]
    return []


def _timing(control: ControlFile) -> list[Issue]:
    """The plant's step goes into the control period, and the delay is a whole number of steps."""
    spec, issues = control.spec, []
    ratio = 1.0 / (spec.rate * spec.plant.step)
    if ratio < 1.0 - 1e-9 or abs(ratio - round(ratio)) > 1e-6 * ratio:
        period = 1.0 / spec.rate
        expected = f"the control period {period:g} s divided by a whole number, such as {period / 4:g}"
        issues.append(control.document.issue(("plant", "step"), f"{spec.plant.step:g} s", expected))
    steps = spec.plant.delay / spec.plant.step
    if abs(steps - round(steps)) > 1e-6 * max(1.0, steps):
        near = [np.floor(steps) * spec.plant.step, np.ceil(steps) * spec.plant.step]
        expected = f"a multiple of the plant's step: {near[0]:g} or {near[1]:g}"
        issues.append(control.document.issue(("plant", "delay"), f"{spec.plant.delay:g} s", expected))
    return issues
