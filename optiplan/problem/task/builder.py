"""`Task`: steps for construction in Python."""

from collections.abc import Mapping, Sequence
from dataclasses import field
from os import PathLike
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from optiplan.arrays import Array, is_listed
from optiplan.config.document import plain
from optiplan.errors import described, wrong_argument
from optiplan.geometry.pose import Pose, Values, checked, place_data
from optiplan.problem.grasps.statement import Grasps
from optiplan.problem.schema.joint_names import lists_of
from optiplan.problem.schema.picks import KINDS, STEP
from optiplan.problem.schema.task import TaskStepSpec
from optiplan.problem.statement import End, Region, ViaPoint, end_data, is_several
from optiplan.problem.to_data import path_constraint_data, via_data
from optiplan.records import dataclass

Targets = str | PathLike[str] | Array | Sequence[Pose | Mapping[str, Any] | Sequence[float]]
"""Targets of a tour, see `Tour`."""


@dataclass(frozen=True, eq=False, repr=False)
class Task:
    """Steps of a task, in order; every method returns a task with one step more.

    Every step takes `name`, `allowed_collisions` (pairs of names that may touch during it), `path_constraints` (what
    holds during it), and where several arms do a task `arm` and `wait_for` (names of steps of other arms).

    Attributes:
        steps: each as a problem file says it.

    Example:
        >>> import optiplan as op
        >>> down = op.Pose((0.5, 0, 0.05), rpy=(3.1416, 0, 0))
        >>> op.Task().approach(down, 0.1).attach("cube", "panda_hand").retreat(0.1)
        Task: approach, attach cube, retreat
    """

    steps: tuple[Mapping[str, Any], ...] = field(default=())

    def move(
        self,
        to: End | Sequence[End],
        *,
        vias: Sequence[ViaPoint | End] = (),
        rides: str | None = None,
        group: str | None = None,
        **step: Any,
    ) -> "Task":
        """Go to an end, or any of several.

        Args:
            to: a `Pose`, values of the group's joints, (k,) or `{joint: value}`, the name of a configuration, or a list
                of these.
            vias: passed on the way.
            rides: an obstacle or a frame that moves: the poses move with it, and are met with their velocity. They are
                those without any displacement.
            group: of joints that move; None: that of the problem.
            step: see the class.
        """
        said: dict[str, Any] = _ends(to, "Task.move") | _vias(vias, "Task.move")
        return self._with("move", said | _given(rides=rides, group=group), step)

    def line(  # noqa: PLR0913
        self,
        to: Pose | None = None,
        *,
        by: Values | None = None,
        within: str | None = None,
        speed: float | None = None,
        frame: str | None = None,
        blend: float | None = None,
        rides: str | None = None,
        group: str | None = None,
        **step: Any,
    ) -> "Task":
        """Move the tool straight to a pose, or by a vector (3,), m, seen from the `world` or the `tool` (`within`).

        Where a line follows, the corner may be rounded off within `blend`, m; without it the arm stops there. `within`
        may name what the arm goes with; `rides` says that the pose moves with that, as of `move`.
        """
        said = {} if to is None else end_data(to, "Task.line", "to")
        more = {"by": by, "in": within, "speed": speed, "frame": frame, "blend": blend, "rides": rides, "group": group}
        return self._with("line", said | _given(**more), step)

    def approach(  # noqa: PLR0913
        self,
        to: Pose | Sequence[Pose] | Grasps | Region,
        distance: float,
        *,
        along: Values = (0.0, 0.0, 1.0),
        speed: float | None = None,
        vias: Sequence[ViaPoint | End] = (),
        blend: float | None = None,
        rides: str | None = None,
        group: str | None = None,
        **step: Any,
    ) -> "Task":
        """Go to `distance`, m, before a pose, then straight `along` an axis of its frame.

        The pose is any of several, any of the `Grasps` of an object, or of a `Region`. `blend` is as of `line`, `rides`
        as of `move`.
        """
        said: dict[str, Any]
        said = {"grasps": to.to_data()} if isinstance(to, Grasps) else _ends(to, "Task.approach")
        if "any_of" in said:
            said["any_of"] = [one["pose"] if "pose" in one else one for one in said["any_of"]]
        said |= _vias(vias, "Task.approach")
        more = {"distance": distance, "along": along, "speed": speed, "blend": blend, "rides": rides, "group": group}
        return self._with("approach", said | _given(**more), step)

    def pick(self, object: str, grasps: Sequence[Pose] | None = None, **pick: Any) -> "Task":
        """Take an object with the fingers: approach, attach, close, lift it off.

        Args:
            object: name of an obstacle, which may move.
            grasps: poses of the tool in the frame of the object; None: all across the least width of a box or cylinder.
            pick: further keys of a `pick` of a problem file, `from_` for its `from`, and those of the step.
        """
        step = {key: pick.pop(key) for key in STEP if key in pick}
        if grasps is not None and (
            isinstance(grasps, str) or not all(isinstance(one, Pose) for one in _listed(grasps))
        ):
            raise wrong_argument("Task.pick", "grasps", described(grasps), "a list of op.Pose")
        poses = None if grasps is None else [end_data(one, "Task.pick", "grasps")["pose"] for one in grasps]
        said = {"object": object, "grasps": poses, "from": pick.pop("from_", None), **pick}
        return self._written("pick", _given(**said), step)

    def place(self, object: str, to: Pose | Sequence[Pose], **place: Any) -> "Task":
        """Put a held object down: approach a pose of the tool, or any of several, open the fingers, let go, go back.

        Args:
            object: name of what is held.
            to: where the tool is then.
            place: further keys of a `place` of a problem file, `open_` for its `open`, and those of the step.
        """
        step = {key: place.pop(key) for key in STEP if key in place}
        said = _ends(to, "Task.place")
        if "any_of" in said:
            said["any_of"] = [one["pose"] if "pose" in one else one for one in said["any_of"]]
        return self._written("place", _given(object=object, open=place.pop("open_", None), **said, **place), step)

    def either(self, *tasks: "Task") -> "Task":
        """Do one of several tasks: the one with which the whole is quickest, and verified.

        Raises:
            InputError: fewer than two tasks, or one without steps.

        Example:
            >>> import optiplan as op
            >>> left, right = (op.Task().line(by=(0, y, 0)) for y in (0.1, -0.1))
            >>> op.Task().move("ready").either(left, right)
            Task: move, either of 2
        """
        for k, one in enumerate(tasks):
            if not isinstance(one, Task) or not one.steps:
                raise wrong_argument("Task.either", f"tasks[{k}]", described(one), "an op.Task with steps")
        if len(tasks) < 2:
            raise wrong_argument("Task.either", "tasks", f"{len(tasks)} of them", "two or more")
        return Task((*self.steps, {"either": [[dict(step) for step in one.steps] for one in tasks]}))

    def wait_until(self, condition: str, **step: Any) -> "Task":
        """Rest until something that moves is somewhere: `"cart.x > 0.3"`, m; y, z, and `angle`, rad, likewise."""
        return self._with("wait_until", condition, step)

    def retreat(
        self,
        distance: float,
        *,
        along: Values | None = None,
        within: str = "tool",
        speed: float | None = None,
        frame: str | None = None,
        blend: float | None = None,
        group: str | None = None,
        **step: Any,
    ) -> "Task":
        """Move the tool straight by `distance`, m, `along` an axis of the `tool` or the `world` (`within`).

        Without `along` it goes back along z of the tool, and up along z of all else. `blend` is as of `line`.
        """
        said = {"distance": distance, "along": along, "in": within, "speed": speed, "frame": frame}
        return self._with("retreat", _given(**said, blend=blend, group=group), step)

    def attach(
        self,
        object: str,
        link: str,
        *,
        touch: Sequence[str] = (),
        mass: float | None = None,
        centre: Values | None = None,
        inertia: Values | None = None,
        **step: Any,
    ) -> "Task":
        """Take an obstacle where it stands; see `Obstacle.attached_to`."""
        touched = list(touch) if is_listed(touch) else touch
        said = {"object": object, "link": link, "touch": touched, "mass": mass, "centre": centre}
        return self._with("attach", _given(**said, inertia=inertia), step)

    def detach(self, object: str, **step: Any) -> "Task":
        """Release what is held; it becomes an obstacle where it is."""
        return self._with("detach", {"object": object}, step)

    def gripper(self, group: str, to: Values | Mapping[str, float] | str, **step: Any) -> "Task":
        """Move the joints of a group to positions, (k,) or `{joint: value}`, rad or m, or to a named configuration."""
        return self._with("gripper", {"group": group, **end_data(to, "Task.gripper", "to")}, step)

    def tool(self, name: str, **step: Any) -> "Task":
        """Change to a tool of the problem's `tools`, or to `none`; where tools have racks the link has to be there."""
        return self._with("tool", name, step)

    def dwell(self, seconds: float, **step: Any) -> "Task":
        """Stand still."""
        return self._with("dwell", seconds, step)

    def tour(self, targets: Targets, order: str = "free", **tour: Any) -> "Task":
        """Visit every target and rest there; see `Tour` for the arguments, and for those of the step.

        Args:
            targets: as of `Tour`.
            order: as of `Tour`.
            tour: further keys of a `tour` of a problem file, and those of the step.
        """
        step = {key: tour.pop(key) for key in STEP if key in tour}
        return self._with("tour", {"targets": _targets(targets), "order": order} | _given(**tour), step)

    def path(self, points: Targets | None, speed: float, **path: Any) -> "Task":
        """Lead the tool along a path at a constant speed that is held; see `Path` for the arguments.

        Args:
            points: as of `Path`.
            speed: m/s.
            path: further keys of a `path` of a problem file, and those of the step.
        """
        step = {key: path.pop(key) for key in STEP if key in path}
        given = {} if points is None else {"points": _targets(points, "Path", "points")}
        return self._with("path", given | {"speed": speed} | _given(**path), step)

    def _with(self, kind: str, said: Any, step: Mapping[str, Any]) -> "Task":
        data = _step(kind, said, step)
        checked(TaskStepSpec, lists_of({"task": [data]})["task"][0], f"Task.{kind}", {})
        return Task((*self.steps, data))

    def _written(self, kind: str, said: Any, step: Mapping[str, Any]) -> "Task":
        """Return the task with a step that is written out later; its poses are in the world, or in the object."""
        data = _step(kind, said, step)
        checked(KINDS[kind], data[kind], f"Task.{kind}", {"from": "from_", "open": "open_"})
        return Task((*self.steps, data))

    def __repr__(self) -> str:
        """Return the steps in words."""
        return f"Task: {', '.join(map(_words, self.steps)) or 'no steps'}"


class Tour(Task):
    """A task of one step: the tool visits every target and rests there, in an order that may be free.

    Args:
        targets: a list of `Pose` or of mappings (`position` with `axis`, `rpy` or `quaternion`, `name`, `after`,
            `cluster`, `window`), an array (k, 6) of positions, m, and axes, or the path of a CSV file.
        order: `free`, or `given`: that of the list.
        tour: `free_axis` ("z": the tool may turn about it), `standoff` (m), `first`, `last` (names), `closed` (back to
            where it began), `at_each` ([{"dwell": 0.4, "do": "weld"}]), `tolerance`, `frame`, `group`.

    Raises:
        InputError: no targets, or keys that are unknown.

    Example:
        >>> import optiplan as op
        >>> op.Tour([op.Pose((0.4, 0.1, 0.3)), op.Pose((0.4, -0.1, 0.3))], free_axis="z")
        Task: tour
    """

    def __init__(self, targets: Targets, order: str = "free", **tour: Any) -> None:
        super().__init__(Task().tour(targets, order, **tour).steps)


class Path(Task):
    """A task of one step: the tool follows a path through points at a constant speed that is held.

    Args:
        points: a list of `Pose` or of mappings (`position` with `axis`, `rpy` or `quaternion`, `through`), an array
            (k, 3) of positions, m, or (k, 6) with axes, or the path of a CSV file; None with `cover`.
        speed: m/s.
        path: `curve` ("line" or "spline"), `blend` and `ramp` (m), `speed_within` (share), `axis`, `free_axis`,
            `cover` ({"mesh": file, "pattern": "raster", "spacing": m}), `cone`, `lead` and `side` (rad), `weave`
            ({"amplitude": m, "length": m}), `at` ([{"path": 0.12, "do": "glue_on"}]), `tolerance`, `frame`, `group`.

    Raises:
        InputError: too few points, or keys that are unknown.

    Example:
        >>> import optiplan as op
        >>> op.Path([[0.4, 0.1, 0.3], [0.4, -0.1, 0.3]], speed=0.1, axis=[0, 0, -1])
        Task: path
    """

    def __init__(self, points: Targets | None, speed: float, **path: Any) -> None:
        super().__init__(Task().path(points, speed, **path).steps)


def _targets(targets: Any, name: str = "Tour", argument: str = "targets") -> Any:
    """Return `targets` of a file, or the points of a path."""
    if isinstance(targets, str | PathLike):
        try:
            return str(FilePath(targets).resolve())
        except ValueError:  # a text that no path can be
            raise wrong_argument(name, argument, described(targets), "the path of a CSV file") from None
    plain_points = argument == "points"
    if isinstance(targets, np.ndarray) and targets.ndim == 2 and targets.shape[1] == 6:
        return [{"position": row[:3], "axis": row[3:]} for row in targets]
    if plain_points and isinstance(targets, np.ndarray) and targets.ndim == 2 and targets.shape[1] == 3:
        return [{"position": row} for row in targets]
    if isinstance(targets, Mapping) or not isinstance(targets, Sequence):
        arrays = "(k, 3) or (k, 6)" if plain_points else "(k, 6)"
        expected = f"a list of Pose or mappings, an array {arrays}, or the path of a CSV file"
        raise wrong_argument(name, argument, described(targets), expected)
    return [_target(one, name, f"{argument}[{k}]", plain_points) for k, one in enumerate(targets)]


def _target(one: Any, name: str, argument: str, plain_points: bool) -> Mapping[str, Any]:
    if isinstance(one, Mapping):
        return one
    if plain_points and isinstance(one, Sequence | np.ndarray) and not isinstance(one, str) and len(one) == 3:
        return {"position": one}
    return place_data(one, name, argument, "op.Pose(position, rpy=…), or a mapping")


def task_data(task: Any) -> list[Any]:
    """`task:` of a file."""
    if isinstance(task, Task):
        return [dict(step) for step in task.steps]
    if isinstance(task, Mapping | str) or not isinstance(task, Sequence):
        raise wrong_argument("Problem", "task", described(task), "op.Task().move(…)…, or a list of steps")
    return [plain(step) for step in task]


def _step(kind: str, said: Any, step: Mapping[str, Any]) -> dict[str, Any]:
    """Return a step as a file has it."""
    more = _given(**step)
    if "path_constraints" in more:
        more["path_constraints"] = path_constraint_data(more["path_constraints"], f"Task.{kind}")
    data: dict[str, Any] = plain({kind: said, **more})
    return data


def _ends(to: Any, function: str) -> dict[str, Any]:
    if not is_several(to):
        return end_data(to, function, "to")
    return {"any_of": [end_data(end, function, f"to[{k}]") for k, end in enumerate(to)]}


def _vias(vias: Any, function: str) -> dict[str, Any]:
    data = [] if vias is None else via_data(vias, function)
    return {"via": data} if data else {}


def _listed(values: Any) -> Sequence[Any]:
    """Return a list as it is; of anything else one that holds no pose."""
    return values if isinstance(values, Sequence) else [None]


def _given(**values: Any) -> dict[str, Any]:
    return {key: value for key, value in values.items() if value is not None}


def _words(step: Mapping[str, Any]) -> str:
    if "either" in step:
        return f"either of {len(step['either'])}"
    kind = next(key for key in step if key in TaskStepSpec.model_fields or key in KINDS)
    about = step[kind].get("object") if isinstance(step[kind], Mapping) else None
    return str(step.get("name") or (f"{kind} {about}" if about else kind))
