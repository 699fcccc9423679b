"""`Problem`: a planning problem as planners and the verifier read it, complete and frozen."""

import html
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from optiplan.arrays import Array
from optiplan.config.document import Document, plain
from optiplan.errors import InputError, described, path_argument, seed_argument, wrong_argument
from optiplan.files import reading, write_text
from optiplan.geometry.scene import Obstacle, Scene
from optiplan.problem import to_data
from optiplan.problem.builder import RobotLoader
from optiplan.problem.constraints.statements import PathConstraint
from optiplan.problem.from_data import Parts, read_problem
from optiplan.problem.goals_and_vias import Goal, JointGoal, Objective, PoseGoal, Via
from optiplan.problem.statement import End, Pose, Values, ViaPoint
from optiplan.problem.task.builder import Task, task_data
from optiplan.problem.task.steps import TaskStep
from optiplan.problem.write import problem_text
from optiplan.robot.reference import UNKNOWN
from optiplan.robot.robot import Limits, Robot, load_robot

__all__ = ["Goal", "JointGoal", "Objective", "Pose", "PoseGoal", "Problem", "Via", "ViaPoint"]

_HERE = "<problem>"
"""Stands for the file of a problem that has none."""

_SAID = {
    "start": ("start", to_data.start_data),
    "goal": ("goal", to_data.goal_data),
    "task": ("task", task_data),
    "vias": ("via", to_data.via_data),
    "scene": ("scene", to_data.scene_data),
    "limits": ("limits", to_data.limits_data),
    "objective": ("objective", to_data.objective_data),
    "path_constraints": ("path_constraints", to_data.path_constraint_data),
    "base": ("base", to_data.base_data),
    "gravity": ("gravity", to_data.gravity_data),
}
"""Parts of a problem: key of the file, and how the part stands there."""


@dataclass(frozen=True, eq=False, init=False, repr=False)
class Problem:
    """A task: which robot goes from where to where, around what, within which limits; never changed.

    The arguments are checked as a problem file is, and give the same problem with the same hash.

    Args:
        robot: a `Robot`, the name of a shipped one, or the path of a robot.yaml.
        start: values of the planned joints (n,), rad or m, or the name of a configuration of the robot.
        goal: a `Pose`, values of the joints (n,), the name of a configuration, or a list of alternatives.
        task: several steps, in place of a goal.
        scene: obstacles and attached objects: a `Scene`, or a list of obstacles; None: empty.
        vias: via points in order: `ViaPoint`, `Pose`, joint values, names of configurations.
        limits: fractions in (0, 1] of the robot's own: `velocity`, `acceleration`, `jerk` (or "none"), `torque`.
        objective: weights of duration and of squared jerk; None: the duration alone.
        path_constraints: what holds on the way: `OrientationCone`, `PositionBox`, `OnPlane`, `OnLine`, `ToolSpeed`,
            `PairClearance`, `RelativePose`.
        base: pose of the robot's root in the world, a `Pose`; None: the identity.
        gravity: acceleration of free fall in the world (3,), m/s²; None: (0, 0, -9.81).
        name: of the problem.
        planner: default of the argument of `op.plan`; None: `trajopt`. With options: `{"name": …, …}`.
        options: of that planner.
        seed: default of the argument of `op.plan`, >= 0.

    With `limits` that are `Limits`, (n,) arrays, the parts are taken as they are, unchecked, and there is no hash: so
    planners make parts of problems, by `dataclasses.replace`.

    Attributes:
        robot: where it stands, with the masses of what it carries (`robot.mounting`).
        start: (n,), rad or m.
        goal: alternatives of the end; none of a task.
        task: steps in order; none where there is a goal.
        vias: to be passed in this order.
        limits: the robot's limits times the given fractions.
        source: the problem as plain data, all defaults filled in; what `save` writes and `run.json` stores.
        hash: SHA-256 of `source` with the contents of the files of the robot and the meshes.

    Raises:
        InputError: every issue found, with the valid values.

    Example:
        >>> import optiplan as op
        >>> shelf = op.Box("shelf", size=(0.8, 0.3, 0.02), position=(0.5, 0, 0.4))
        >>> goal = op.Pose((0.5, 0.2, 0.6), rpy=(3.14, 0, 0))
        >>> op.Problem(op.load_robot("panda"), start="ready", goal=goal, scene=[shelf])
        Problem: problem, panda, to a pose of panda_hand_tcp; 1 obstacle (shelf)
    """

    name: str
    robot: Robot
    scene: Scene
    start: Array
    goal: Goal
    limits: Limits
    vias: tuple[Via, ...]
    task: tuple[TaskStep, ...]
    objective: Objective
    path_constraints: tuple[PathConstraint, ...]
    planner: str
    options: Mapping[str, Any]
    seed: int
    source: Mapping[str, Any] = field(init=False)
    hash: str = field(init=False)

    def __init__(
        self,
        robot: Robot | str | Path | Mapping[str, Any],
        start: Values | str | Mapping[str, Any],
        goal: End | Sequence[End] | None = None,
        scene: Scene | Sequence[Obstacle] | Mapping[str, Any] | None = None,
        *,
        task: Task | Sequence[TaskStep | Mapping[str, Any]] | None = None,
        vias: Sequence[ViaPoint | Via | End] = (),
        limits: Mapping[str, float | str] | Limits | None = None,
        objective: Objective | Mapping[str, float] | None = None,
        path_constraints: Sequence[PathConstraint | Mapping[str, Any]] = (),
        base: Pose | Mapping[str, Any] | None = None,
        gravity: Values | None = None,
        name: str = "problem",
        planner: str | Mapping[str, Any] | None = None,
        options: Mapping[str, Any] | None = None,
        seed: int = 0,
    ) -> None:
        given = {"start": start, "goal": goal, "scene": scene, "vias": vias, "limits": limits, "objective": objective}
        given |= {"task": task, "path_constraints": path_constraints}
        stands = {"base": base, "gravity": gravity}
        labels = {"name": name, "seed": seed}
        labels |= {"planner": "trajopt" if planner is None else planner, "options": {} if options is None else options}
        needed = "start" if goal is None and task is not None else "goal"
        if isinstance(limits, Limits):
            rest = {"scene": scene or Scene(), "vias": tuple(vias), "objective": objective or Objective()}
            rest |= {"path_constraints": tuple(path_constraints), "task": _steps(task)}
            self._set({"robot": robot, **given, **labels, **rest, "source": {}, "hash": ""})
        else:
            self._take(
                _read(
                    robot,
                    {k: value for k, value in (given | stands).items() if value is not None or k == needed},
                    labels,
                )
            )

    def _set(self, parts: Mapping[str, Any]) -> None:
        for name, value in parts.items():
            object.__setattr__(self, name, value)
        if "start" in parts:  # nobody writes into what the hash is about
            start = np.array(parts["start"])
            start.flags.writeable = False
            object.__setattr__(self, "start", start)

    def _take(self, parts: Parts) -> None:
        self._set({one.name: getattr(parts, one.name) for one in fields(Parts)})

    @classmethod
    def of(cls, parts: Parts) -> "Problem":
        """Return the problem that was read."""
        problem = object.__new__(cls)
        problem._take(parts)
        return problem

    @property
    def one_end(self) -> bool:
        """Return whether every solution ends in the same configuration, up to a tolerance.

        False for poses, for several alternatives, and for unbounded joints, which may arrive a turn away.
        """
        endless = np.isinf(self.robot.limits.lower) & np.isinf(self.robot.limits.upper)
        return len(self.goal) == 1 and isinstance(self.goal[0], JointGoal) and not endless.any()

    def with_seed(self, seed: int) -> "Problem":
        """Return the problem with another seed, which changes neither source nor hash.

        Raises:
            InputError: not a whole number from 0 upwards.
        """
        other = replace(self, seed=seed_argument("Problem.with_seed", seed))
        other._set({"source": self.source, "hash": self.hash})
        return other

    def with_start(self, start: Values | str) -> "Problem":
        """Return the problem with another start configuration (n,), rad or m, or the name of one.

        Raises:
            InputError: as for a file: it is outside the limits or in collision.
        """
        return self._with(start=start)

    def with_goal(self, *goal: End | Sequence[End]) -> "Problem":
        """Return the problem with another goal, or several alternatives.

        Raises:
            InputError: as for a file: none of them can be reached, or a joint tolerance that no file can state.
        """
        return self._with(goal=goal[0] if len(goal) == 1 else goal)

    def with_vias(self, *vias: ViaPoint | Via | End) -> "Problem":
        """Return the problem with other vias, or none.

        Raises:
            InputError: as for a file.
        """
        return self._with(vias=vias)

    def with_task(self, task: Task | Sequence[Mapping[str, Any]]) -> "Problem":
        """Return the problem with another task.

        Raises:
            InputError: as for a file.
        """
        return self._with(task=task)

    def with_scene(self, scene: Scene | Sequence[Obstacle]) -> "Problem":
        """Return the problem in another scene.

        Raises:
            InputError: as for a file: names that are taken or unknown, a start in collision.
        """
        return self._with(scene=scene)

    def with_constraints(self, *constraints: PathConstraint | Mapping[str, Any]) -> "Problem":
        """Return the problem with these path constraints, or none.

        Raises:
            InputError: as for a file: unknown frames or bodies, a start or goal that violates one.
        """
        return self._with(path_constraints=constraints)

    def with_base(self, base: Pose | Mapping[str, Any]) -> "Problem":
        """Return the problem with the robot's root at another pose in the world; obstacles and poses stay.

        Raises:
            InputError: as for a file: not a pose, a start in collision.
        """
        return self._with(base=base)

    def with_gravity(self, gravity: Values) -> "Problem":
        """Return the problem with another acceleration of free fall in the world (3,), m/s².

        Raises:
            InputError: as for a file.
        """
        return self._with(gravity=gravity)

    def with_limits(self, **fractions: float | str) -> "Problem":
        """Return the problem with other limit fractions: `velocity`, `acceleration`, `jerk` (or "none"), `torque`.

        Fractions not given are 1.

        Raises:
            InputError: as for a file: there is no such limit, or the fraction is not in (0, 1].
        """
        return self._with(limits=fractions)

    def save(self, path: Path | str) -> None:
        """Write the problem as a YAML file, which is there whole or not at all; reading it gives the same hash.

        Files of robots and meshes stay where they are and are named by their whole paths.

        Raises:
            InputError: the file cannot be written, or the problem was put together by hand.
        """
        if not self.source:
            found = "a problem that was put together by hand"
            raise wrong_argument("Problem.save", "problem", found, "one that was read, or made by op.Problem(…)")
        file = path_argument("Problem.save", "path", path, "the path of a file")
        try:
            write_text(file, problem_text(self.source))
        except OSError as error:
            found = f"{str(path)!r} ({(error.strerror or str(error)).lower()})"
            raise wrong_argument("Problem.save", "path", found, "a file that can be written") from None

    def _with(self, **changes: Any) -> "Problem":
        if self.source:
            data = dict(self.source) | {_SAID[part][0]: _SAID[part][1](value) for part, value in changes.items()}
            return Problem.of(_checked(data, self.robot)).with_seed(self.seed)
        if {"base", "gravity"} & changes.keys():
            raise wrong_argument("Problem", "problem", "a problem that was put together by hand", "one with a source")
        if "limits" in changes:
            changes["limits"] = self.robot.limits.scaled(**changes["limits"])
        if "goal" in changes and isinstance(changes["goal"], JointGoal | PoseGoal):
            changes["goal"] = (changes["goal"],)
        return replace(self, **changes)

    def __repr__(self) -> str:
        """Name, robot, goal and scene in one line."""
        around = str(self.scene).removeprefix("Scene: ")
        past = f" past {len(self.vias)} points" if self.vias else ""
        to = f"to {self._end()}"
        return f"Problem: {self.name}, {self.robot.name}, {to}{past}; {around}"

    def _end(self) -> str:
        """The goal in words."""
        if self.task:
            return f"do {self.task[-1].number} steps"
        if len(self.goal) != 1:
            return f"any of {len(self.goal)} ends"
        goal = self.goal[0]
        return "a configuration" if isinstance(goal, JointGoal) else f"a pose of {goal.frame}"

    def _repr_html_(self) -> str:
        """A small table for notebooks."""
        rows = {
            "robot": f"{self.robot.name}, {self.robot.n} joints",
            "start": ", ".join(f"{q:.4g}" for q in self.start),
            "goal": self._end(),
            "via points": len(self.vias) or "",
            "scene": str(self.scene).removeprefix("Scene: "),
            "hash": f"{self.hash:.12}",
        }
        cells = "".join(f"<tr><th>{key}</th><td>{html.escape(str(v))}</td></tr>" for key, v in rows.items() if v)
        return f"<table><caption>Problem: {html.escape(self.name)}</caption>{cells}</table>"


def _steps(task: Any) -> tuple[TaskStep, ...]:
    """Return the steps of a problem that is put together by hand."""
    return () if task is None else tuple(task)


def _read(robot: Any, given: Mapping[str, Any], labels: Mapping[str, Any]) -> Parts:
    """Return the parts of a problem built in Python."""
    if not isinstance(robot, Robot | str | Path | Mapping):
        expected = "op.load_robot(…), op.Robot.from_urdf(…), the name of a robot or the path of a robot.yaml"
        raise wrong_argument("Problem", "robot", described(robot), expected)
    data = {_SAID[part][0]: _SAID[part][1](value) for part, value in given.items()}
    data |= {"version": 1, "name": labels["name"], "seed": labels["seed"], "robot": robot}
    data["planner"] = to_data.planner_data(labels["planner"], labels["options"])
    if isinstance(robot, str | Path) and Path(robot).suffix.lower() == ".urdf":
        data["robot"] = {"urdf": robot}
    if not isinstance(robot, Robot):
        return _checked(data)
    by = robot.reference
    if by == UNKNOWN:
        raise wrong_argument("Problem", "robot", "a robot that was put together by hand", "one that was loaded")
    data |= {"robot": by.robot, "locked": by.locked} | ({} if by.group is None else {"group": by.group})
    if robot.tool_frame != by.tool_frame:
        for pose in to_data.poses(data):
            pose.setdefault("frame", robot.tool_frame)
    return _checked(data, robot)


def _checked(data: Mapping[str, Any], robot: Robot | None = None) -> Parts:
    """Return the parts of a problem of plain data, with this robot, if one is given.

    Raises:
        InputError: as for a file.
    """
    loader = load_robot if robot is None else _loader(robot)
    try:
        with reading(None):
            return read_problem(Document(Path(_HERE), plain(data), {}), Path.cwd(), loader).whole()
    except InputError as error:
        raise error.about(_HERE, "op.Problem") from None


def _loader(robot: Robot) -> RobotLoader:
    """Return what loads this robot, or other groups of its joints."""

    def load(
        ref: str | Mapping[str, Any], base: Path | None, locked: Mapping[str, float] | None, group: str | None
    ) -> Robot:
        if group in (robot.reference.group, None):
            return robot
        return replace(load_robot(ref, base, locked, group), tool_frame=robot.tool_frame)

    return load
