"""Read a problem from the arguments of `op.Problem`, by way of the data that a file would hold."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from optiplan.config.document import Document, plain
from optiplan.errors import InputError, described, errors_about, wrong_argument
from optiplan.files import reading
from optiplan.geometry.scene import Scene
from optiplan.problem import to_data
from optiplan.problem.builder import RobotLoader
from optiplan.problem.from_data import in_one_form, read_problem
from optiplan.robot.reference import UNKNOWN
from optiplan.robot.robot import Robot, load_robot

if TYPE_CHECKING:
    from optiplan.problem.constraints.expression import Expression
    from optiplan.problem.problem import Problem

NO_FILE = "<problem>"
"""Stands for the file of a problem that has none."""


def _task(task: Any) -> Any:
    from optiplan.problem.task.builder import task_data

    return task_data(task)


def _tools(tools: Any) -> Any:
    from optiplan.problem.tools.statement import tools_data

    return tools_data(tools)


def _tool(tool: Any) -> Any:
    from optiplan.problem.tools.statement import tool_data

    return tool_data(tool)


ARGUMENT_WRITERS = {
    "start": ("start", to_data.start_data),
    "goal": ("goal", to_data.goal_data),
    "task": ("task", _task),
    "tools": ("tools", _tools),
    "tool": ("tool", _tool),
    "frames": ("frames", to_data.frames_data),
    "vias": ("via", to_data.via_data),
    "scene": ("scene", to_data.scene_data),
    "limits": ("limits", to_data.limits_data),
    "objective": ("objective", to_data.objective_data),
    "path_constraints": ("path_constraints", to_data.path_constraint_data),
    "tracking_error": ("tracking_error", plain),
    "clearance": ("clearance", to_data.clearance_data),
    "base": ("base", to_data.base_data),
    "gravity": ("gravity", plain),
}
"""Parts of a problem: key of the file, and how the part stands there."""


def arguments_data(arguments: Mapping[str, Any]) -> dict[str, Any]:
    """Return parts of a problem, by the names of their arguments, as they stand in a file."""
    written = [(*ARGUMENT_WRITERS[name], value) for name, value in arguments.items()]
    found = {key: write(value) for key, write, value in written}
    if isinstance(scene := arguments.get("scene"), Scene) and (scene.safety is not None or scene.unwished):
        found.setdefault("clearance", 0.0 if scene.safety is None else scene.safety.to_data())
    return found


def read_arguments(robot: Any, arguments: Mapping[str, Any], labels: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return the attributes of a problem of these arguments; `labels` stand in a file as they are.

    Raises:
        InputError: as for a file, about the arguments of `op.Problem`.
    """
    if not isinstance(robot, Robot | str | Path | Mapping):
        expected = "op.load_robot(…), op.Robot.from_urdf(…), the name of a robot or the path of a robot.yaml"
        raise wrong_argument("Problem", "robot", described(robot), expected)
    data = {**arguments_data(arguments), **labels, "version": 1, "robot": robot}
    if isinstance(robot, str | Path) and Path(robot).suffix.lower() == ".urdf":
        data["robot"] = {"urdf": robot}
    if not isinstance(robot, Robot):
        return read_data(data)
    by = robot.reference
    if by == UNKNOWN:
        raise wrong_argument("Problem", "robot", "a robot that was put together by hand", "one that was loaded")
    if robot.held:
        found = f"a robot whose joints {', '.join(robot.held)} are fixed by `holding`"
        raise wrong_argument("Problem", "robot", found, "op.load_robot(…, group=…, locked=…)")
    data |= {"robot": by.robot, "locked": by.locked} | ({} if by.group is None else {"group": by.group})
    own = robot.unmounted.model.existFrame(robot.tool_frame)  # else it is that of a tool of another problem
    if robot.tool_frame != by.tool_frame and own:
        return read_data(_with_frames(data, robot), robot)
    return read_data(data, robot)


def _with_frames(data: Mapping[str, Any], robot: Robot) -> Mapping[str, Any]:
    """Return the data of a problem with the tool frame of its robot, which no file has, at each place that uses it."""
    try:
        with reading(None):
            stated = in_one_form(Document(Path(NO_FILE), plain(data), {}), Path.cwd(), _loader(robot)).data
    except InputError:
        return data  # reading it reports this, and all else that is wrong
    others = [group for group in robot.tool_frames if set(robot.groups.get(group, ())) != set(robot.joint_names)]
    for statement in to_data.tool_statements(stated, others):
        statement.setdefault("frame", robot.tool_frame)
    return dict(stated)


def split_expressions(constraints: Any) -> "tuple[Any, list[Expression]]":
    """Return the constraints that a file can state, and the users' own."""
    if not isinstance(constraints, Sequence) or not constraints:
        return constraints, []  # not a list at all is told by the reader of arguments
    from optiplan.problem.constraints.expression import Expression

    own = [one for one in constraints if isinstance(one, Expression)]
    return ([one for one in constraints if not isinstance(one, Expression)] if own else constraints), own


def expression_names(constraints: Any) -> list[str]:
    """Return the names of the constraints that no file holds."""
    return [one.name for one in split_expressions(constraints)[1]]


def file_data(problem: "Problem", function: str) -> Mapping[str, Any]:
    """Return a problem as a file holds it, for a function that hands it on without what no file holds.

    Raises:
        InputError: it was put together by hand, or has an expression.
    """
    if not problem.source:
        found = "a problem that was put together by hand"
        raise wrong_argument(function, "problem", found, "one that was read, or made by op.Problem(…)")
    if names := expression_names(problem.path_constraints):
        found = f"a problem with the expression '{names[0]}'"
        raise wrong_argument(function, "problem", found, "constraints that a file can hold")
    return problem.source


def read_data(data: Mapping[str, Any], robot: Robot | None = None) -> Mapping[str, Any]:
    """Return the attributes of a problem of plain data, with this robot, if one is given.

    Raises:
        InputError: as for a file, about the arguments of `op.Problem`.
    """
    loader = load_robot if robot is None else _loader(robot)
    with errors_about(NO_FILE, "op.Problem"), reading(None):
        return read_problem(Document(Path(NO_FILE), plain(data), {}), Path.cwd(), loader)


def _loader(robot: Robot) -> RobotLoader:
    """Return what loads this robot, or other groups of its joints."""

    def load(
        ref: str | Mapping[str, Any], base: Path | None, locked: Mapping[str, float] | None, group: str | None
    ) -> Robot:
        if group == robot.reference.group:  # of a task that moves more groups, the robot has the joints of all
            return robot
        own = load_robot(ref, base, locked, group)  # without the tool of a file that `robot` may carry
        return replace(own, tool_frame=robot.tool_frame) if own.model.existFrame(robot.tool_frame) else own

    return load
