"""`Problem`: a planning problem as planners and the verifier read it, complete and frozen."""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from optiplan.arrays import Array, ReadOnlyArrays, read_only
from optiplan.errors import counted, path_argument, seed_argument, writing, wrong_argument
from optiplan.files import write_text
from optiplan.geometry.pose import Pose, Values
from optiplan.geometry.scene import Obstacle, Scene
from optiplan.kinematics.ik.joint_wraps import ROUNDING, endless_turns
from optiplan.problem.free_space import FreeSpace
from optiplan.problem.goals_and_vias import Goal, GoalEnd, JointGoal, PoseGoal, Via
from optiplan.problem.objectives.objective import Objective
from optiplan.problem.objectives.parts import ObjectiveParts
from optiplan.problem.regions.region import RegionGoal
from optiplan.problem.tools.tool import MountedTool
from optiplan.problem.tracking_error import TrackingError, error_argument
from optiplan.problem.write import end_words, problem_table, problem_text
from optiplan.records import dataclass
from optiplan.robot.robot import Limits, Robot
from optiplan.trajectory.state import State
from optiplan.trajectory.timing.lower_bound import lower_bounds, moving_bounds
from optiplan.trajectory.trajectory import Trajectory

if TYPE_CHECKING:
    from optiplan.problem.constraints.expression import Expression
    from optiplan.problem.constraints.statements import PathConstraint
    from optiplan.problem.statement import End, ViaPoint
    from optiplan.problem.task.builder import Task
    from optiplan.problem.task.steps import TaskStep
    from optiplan.problem.tools.statement import Tool

__all__ = ["Goal", "GoalEnd", "JointGoal", "Objective", "Pose", "PoseGoal", "Problem", "RegionGoal", "Via", "ViaPoint"]


@dataclass(frozen=True, eq=False, init=False, repr=False)
class Problem(ReadOnlyArrays, FreeSpace):
    """A task: which robot goes from where to where, around what, within which limits; never changed.

    The arguments are checked as a problem file is, and give the same problem with the same hash.

    Args:
        robot: a `Robot`, the name of a shipped one, or the path of a robot.yaml.
        start: values of the planned joints (n,) or `{joint: value}`, rad or m, the name of a configuration of the
            robot, or a `State` of a robot that is moving.
        goal: a `Pose`, a `Region`, values of the joints, the name of a configuration, a `State` to arrive in, or
            a list of alternatives.
        task: several steps, in place of a goal.
        frames: frames that move, as of a file: `{"belt": {"position": (…), "motion": {"polynomial": …}}}`.
        scene: obstacles and attached objects: a `Scene`, or a list of obstacles; None: empty.
        tools: `Tool`s that the task changes to, with their racks.
        tool: the tool that is mounted at first: a name of `tools`, or a `Tool`; None: none.
        vias: via points in order: `ViaPoint`, `Pose`, joint values, names of configurations.
        limits: fractions in (0, 1] of the robot's own: `velocity`, `acceleration`, `jerk` (or "none"), `torque`.
        objective: weights of duration, jerk, energy and more, see `Objective`; None: the duration alone.
        path_constraints: what holds on the way: `OrientationCone`, `PositionBox`, `ToolSpeed`, `PairClearance`, ….
        base: pose of the robot's root in the world, a `Pose`; None: the identity.
        gravity: acceleration of free fall in the world (3,), m/s²; None: (0, 0, -9.81).
        tracking_error: how far joints may be from the motion, rad or m: a number, (n,) or `{joint: value}`; None: 0.
        name: of the problem.
        planner: default of the argument of `op.plan`; None: `trajopt`. With options: `{"name": …, …}`.
        options: of that planner.
        seed: default of the argument of `op.plan`, >= 0.
        start_velocity: (n,), rad/s or m/s; None: that of the `State`, else zeros.
        start_acceleration: (n,), rad/s² or m/s²; None: that of the `State`, else zeros.

    Attributes:
        robot: where it stands, with the masses of what it carries (`robot.mounting`).
        start: (n,), rad or m.
        start_velocity, start_acceleration: (n,), at the start; zeros: at rest.
        goal: alternatives of the end; none of a task.
        task: steps in order; none where there is a goal.
        tools: all tools; the scene has the bodies of the one that is mounted, and of those in racks.
        vias: to be passed in this order.
        limits: the robot's limits times the given fractions.
        tracking_error: (n,) rad or m; motions are proved for every configuration that is no farther from them.
        wished_clearance: m; bodies stay so far apart where that costs little. 0 where a `clearance` is stated.
        source: the problem as plain data with all defaults, as in `save` and `run.json`; empty of one `derived`.
        hash: SHA-256 of `source` with the contents of the files of the robot and the meshes; likewise.

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
    start_velocity: Array
    start_acceleration: Array
    goal: Goal
    limits: Limits
    tracking_error: Array
    wished_clearance: float
    vias: tuple[Via, ...]
    task: "tuple[TaskStep, ...]"
    tools: tuple[MountedTool, ...]
    objective: Objective
    path_constraints: "tuple[PathConstraint, ...]"
    planner: str
    options: Mapping[str, Any]
    seed: int
    source: Mapping[str, Any]
    hash: str

    def __init__(
        self,
        robot: Robot | str | Path | Mapping[str, Any],
        start: Values | str | State | Mapping[str, Any],
        goal: "End | Sequence[End] | None" = None,
        scene: Scene | Sequence[Obstacle] | Mapping[str, Any] | None = None,
        *,
        task: "Task | Sequence[TaskStep | Mapping[str, Any]] | None" = None,
        frames: Mapping[str, Mapping[str, Any]] | None = None,
        tools: "Sequence[Tool] | Mapping[str, Any] | None" = None,
        tool: "Tool | str | Mapping[str, Any] | None" = None,
        vias: "Sequence[ViaPoint | Via | End]" = (),
        limits: Mapping[str, float | str] | None = None,
        objective: Objective | Mapping[str, float] | None = None,
        path_constraints: "Sequence[PathConstraint | Mapping[str, Any]]" = (),
        base: Pose | Mapping[str, Any] | None = None,
        gravity: Values | None = None,
        tracking_error: TrackingError | Array | None = None,
        name: str = "problem",
        planner: str | Mapping[str, Any] | None = None,
        options: Mapping[str, Any] | None = None,
        seed: int = 0,
        start_velocity: Values | None = None,
        start_acceleration: Values | None = None,
    ) -> None:
        from optiplan.problem import from_python, to_data

        if start_velocity is not None or start_acceleration is not None:
            start = to_data.moving_start(start, start_velocity, start_acceleration)
        in_file, expressions = from_python.split_expressions(path_constraints)
        given = {"start": start, "goal": goal, "task": task, "scene": scene, "vias": vias, "limits": limits}
        given |= {"objective": objective, "path_constraints": in_file, "base": base, "gravity": gravity}
        given |= {"tracking_error": tracking_error, "tools": tools, "tool": tool, "frames": frames}
        needed = {"start"} if task is not None else {"start", "goal"}
        chosen = to_data.planner_data("trajopt" if planner is None else planner, options)
        labels = {"name": name, "seed": seed, "planner": chosen}
        stated = {key: value for key, value in given.items() if value is not None or key in needed}
        self._set(from_python.read_arguments(robot, stated, labels))
        self._add_expressions(expressions)

    def _set(self, parts: Mapping[str, Any]) -> None:
        for name, value in parts.items():
            object.__setattr__(self, name, value)
        for name in {"start", "start_velocity", "start_acceleration", "tracking_error"} & parts.keys():
            # nobody writes into what the hash is about
            object.__setattr__(self, name, read_only(np.array(parts[name])))

    @classmethod
    def of(cls, parts: Mapping[str, Any]) -> "Problem":
        """Return the problem of these attributes, as they are; a tracking error or a wish that is missing is 0."""
        problem = object.__new__(cls)
        problem._set({"tracking_error": np.zeros(parts["robot"].n), "wished_clearance": 0.0, "tools": (), **parts})
        return problem

    @property
    def one_end(self) -> bool:
        """Return whether every solution ends in the same configuration, up to a tolerance.

        False for poses, for several alternatives, and for unbounded joints, which may arrive a turn away.
        """
        return len(self.goal) == 1 and isinstance(self.goal[0], JointGoal) and not self.robot.endless.any()

    @property
    def start_state(self) -> State:
        """The motion at the start."""
        return State.of(self.start, self.start_velocity, self.start_acceleration)

    @property
    def nonzero_ends(self) -> bool:
        """Whether the robot moves at the start or at some goal."""
        return self.moving_start or any(isinstance(goal, JointGoal) and goal.moving for goal in self.goal)

    @property
    def moving_start(self) -> bool:
        """Whether the robot moves at the start."""
        return bool(self.start_velocity.any() or self.start_acceleration.any())

    def end_states(self, q: Array) -> list[State]:
        """Return the states in which a motion that ends at q (n,) may arrive: at rest, or as goals there say."""
        if not self.nonzero_ends:
            return [State.of(q, np.zeros(len(q)), np.zeros(len(q)))]
        rates = [goal.state for goal in self.goal if isinstance(goal, JointGoal) and self._there(goal, q)]
        return [State(q, rate.v, rate.a) for rate in rates] or [State(q)]

    def _there(self, goal: JointGoal, q: Array) -> bool:
        """Whether q (n,) is within the tolerance of a goal, up to whole turns of joints that turn without end."""
        nearest = endless_turns(self.robot, goal.q, q, 1)[0]
        return bool((np.abs(q - nearest) <= goal.tolerance + ROUNDING).all())

    def lower_bounds(self, ends: Array | Sequence[Array]) -> Array:
        """Return the shortest duration conceivable from the start to each of the configurations (k, n): (k,), s.

        In the states of motion of the problem's start and goals; obstacles and limits of position are ignored.
        """
        if not self.nonzero_ends:
            return lower_bounds(self.start, np.asarray(ends), self.limits)
        start = self.start_state
        return np.array([moving_bounds(start, self.end_states(q), self.limits).min() for q in np.asarray(ends)])

    def with_seed(self, seed: int) -> "Problem":
        """Return the problem with another seed, which changes neither source nor hash.

        Raises:
            InputError: not a whole number from 0 upwards.
        """
        return Problem.of({**vars(self), "seed": seed_argument("Problem.with_seed", seed)})

    def with_start(self, start: Values | str | State) -> "Problem":
        """Return the problem with another start: a configuration (n,), rad or m, the name of one, or a `State`.

        Raises:
            InputError: as for a file: it is outside the limits or in collision.
        """
        return self._with(start=start)

    def with_goal(self, *goal: "End | Sequence[End]") -> "Problem":
        """Return the problem with another goal, or several alternatives, in place of a task too.

        Raises:
            InputError: as for a file: none of them can be reached, or a joint tolerance that no file can state.
        """
        return self._with(goal=goal[0] if len(goal) == 1 else goal)

    def with_vias(self, *vias: "ViaPoint | Via | End") -> "Problem":
        """Return the problem with other vias, or none.

        Raises:
            InputError: as for a file.
        """
        return self._with(vias=vias)

    def with_task(self, task: "Task | Sequence[Mapping[str, Any]]") -> "Problem":
        """Return the problem with another task, in place of a goal with its vias too.

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

    def with_constraint(self, constraint: "PathConstraint | Mapping[str, Any]") -> "Problem":
        """Return the problem with one more path constraint; raises what `with_constraints` does."""
        return self.with_constraints(*self.path_constraints, constraint)

    def with_constraints(self, *constraints: "PathConstraint | Mapping[str, Any]") -> "Problem":
        """Return the problem with these path constraints, or none: `op.OrientationCone(…)`, `op.Expression(…)`, ….

        Raises:
            InputError: as for a file: unknown frames or bodies, a start or goal that violates one.
        """
        return self._with(path_constraints=constraints)

    def with_objective(self, objective: Objective | Mapping[str, float]) -> "Problem":
        """Return the problem with another objective.

        Raises:
            InputError: as for a file: there is no such part, a weight < 0, or all are 0.
        """
        return self._with(objective=objective)

    def objective_parts(self) -> ObjectiveParts:
        """Return the parts of the objective, to be evaluated for motions."""
        return ObjectiveParts(self.robot, self.scene, self.objective)

    def cost(self, trajectory: Trajectory) -> float:
        """Return the weighted sum of all parts of the objective of a motion, s."""
        return self.objective_parts().cost(trajectory)

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

    def with_parts(self, **parts: Any) -> "Problem":
        """Return the problem with several parts changed at once: `start`, `goal`, `scene` …; checked as a file is."""
        return self._with(**parts)

    def save(self, path: Path | str) -> None:
        """Write the problem as a YAML file, which is there whole or not at all; reading it gives the same hash.

        Files of robots and meshes stay where they are and are named by their whole paths.

        Raises:
            InputError: the file cannot be written, or holds no such problem: put together by hand, or with an
                expression.
        """
        from optiplan.problem.from_python import file_data

        text = problem_text(file_data(self, "Problem.save"))
        with writing("Problem.save", path):
            write_text(path_argument("Problem.save", "path", path, "the path of a file"), text)

    def _with(self, **changes: Any) -> "Problem":
        from optiplan.problem.from_python import ARGUMENT_WRITERS, arguments_data, read_data, split_expressions

        if unknown := changes.keys() - ARGUMENT_WRITERS.keys():
            expected = f"one of: {', '.join(ARGUMENT_WRITERS)}"
            raise wrong_argument("Problem.with_parts", "part", f"'{min(unknown)}'", expected)
        gone = {part for one, parts in _INSTEAD.items() if one in changes for part in parts}
        if self.source:
            constraints, expressions = split_expressions(changes.get("path_constraints", self.path_constraints))
            if "path_constraints" in changes:
                changes["path_constraints"] = constraints
            without = {ARGUMENT_WRITERS[part][0] for part in gone}
            data = {key: said for key, said in self.source.items() if key not in without} | arguments_data(changes)
            other = Problem.of(read_data(data, self.robot)).with_seed(self.seed)
            other._add_expressions(expressions)
            return other
        if {"base", "gravity", "clearance", "frames", "tool"} & changes.keys():
            raise wrong_argument("Problem", "problem", "a problem that was put together by hand", "one with a source")
        if "start" in changes:
            said = changes["start"]
            start = said if isinstance(said, State) else State(said, robot=self.robot)
            changes |= {"start": start.q, "start_velocity": start.v, "start_acceleration": start.a}
        if "limits" in changes:
            changes["limits"] = self.robot.limits.scaled(**changes["limits"])
        if "goal" in changes and isinstance(changes["goal"], GoalEnd):
            changes["goal"] = (changes["goal"],)
        if "tracking_error" in changes:
            changes["tracking_error"] = error_argument("Problem", self.robot, changes["tracking_error"])
        return derived(self, **{**dict.fromkeys(gone, ()), **changes})

    def _add_expressions(self, expressions: "Sequence[Expression]") -> None:
        """Add users' constraints, which no file holds: they are part of the hash, and `source` does not show them."""
        if not expressions:
            return
        goals = [goal.state for goal in self.goal if isinstance(goal, JointGoal)]
        ends = goals if len(goals) == len(self.goal) else []
        digests = "".join(one.checked(self.robot, self.start_state, ends) for one in expressions)
        self._set({"path_constraints": (*self.path_constraints, *expressions)})
        self._set({"hash": hashlib.sha256((self.hash + digests).encode()).hexdigest()})

    def __repr__(self) -> str:
        """Name, robot, goal and scene in one line."""
        past = f" past {counted(len(self.vias), 'point')}" if self.vias else ""
        return f"Problem: {self.name}, {self.robot.name}, to {self._end}{past}; {self._around}"

    def _repr_html_(self) -> str:
        """The same with the start and the hash, as a small table for notebooks."""
        rows: dict[str, Any] = {"robot": f"{self.robot.name}, {self.robot.n} joints"}
        rows |= {"start": ", ".join(f"{q:.4g}" for q in self.start), "goal": self._end, "via points": len(self.vias)}
        return problem_table(self.name, rows | {"scene": self._around, "hash": f"{self.hash:.12}"})

    @property
    def _end(self) -> str:
        return end_words(self.goal, self.task[-1].number if self.task else 0)

    @property
    def _around(self) -> str:
        return str(self.scene).removeprefix("Scene: ")


def derived(problem: Problem, **changes: Any) -> Problem:
    """Return a problem with other values of its attributes, as they are: unchecked, without source and hash.

    So planners make the legs of a problem; no `run.json` can describe another problem than the one planned.

    Raises:
        TypeError: an attribute that there is not, or `source` or `hash`.
    """
    if unknown := changes.keys() - _CHANGEABLE:
        raise TypeError(f"a problem derived from another has no {', '.join(sorted(unknown))} of its own")
    return Problem.of({**vars(problem), **changes, "source": {}, "hash": ""})


_INSTEAD = {"task": ("goal", "vias"), "goal": ("task",)}
"""Parts that another one takes the place of."""

_CHANGEABLE = {one.name for one in fields(Problem)} - {"source", "hash"}
