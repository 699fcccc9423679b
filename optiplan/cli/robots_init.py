"""`optiplan robots init`: from a URDF to a robot.yaml and the SRDF of the pairs that need no check."""

import os
import re
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from optiplan.cli.output import messages, print_json, results, stdout_is_ours
from optiplan.errors import InputError, Issue, OptiPlanError, UnknownChoiceError

if TYPE_CHECKING:
    from optiplan.model.robot import Robot

YAML_NAME, SRDF_NAME = "robot.yaml", "robot.srdf"
MOST_ASKED = 8
"""Joints outside the group whose position is asked for; of a hand with forty, all keep theirs."""

UNITS = {"velocity": "rad/s", "acceleration": "rad/s²", "jerk": "rad/s³", "torque": "N·m"}


@dataclass(frozen=True)
class Choices:
    """What a robot.yaml says beside the names of its files; empty where OptiPlan's own choice stands."""

    group: tuple[str, ...] = ()
    tool: str = ""
    locked: tuple[tuple[str, float], ...] = ()
    limits: tuple[tuple[str, float], ...] = ()


def init(
    context: typer.Context,
    urdf: Annotated[Path, typer.Argument(metavar="URDF", help="the robot's URDF")],
    out: Annotated[Path | None, typer.Option("--out", metavar="DIR", help="folder of the files; the URDF's")] = None,
    name: Annotated[str | None, typer.Option("--name", metavar="NAME", help="of the robot; the URDF's")] = None,
    group: Annotated[str | None, typer.Option("--group", metavar="J1,J2,…", help="joints to plan")] = None,
    tool: Annotated[str | None, typer.Option("--tool", metavar="FRAME", help="the frame that goals are for")] = None,
    lock: Annotated[list[str] | None, typer.Option("--lock", metavar="JOINT=Q", help="where a joint stands")] = None,
    limit: Annotated[list[str] | None, typer.Option("--limit", metavar="KEY=X", help="limit of all joints")] = None,
    force: Annotated[bool, typer.Option("--force", help="replace files that are there")] = False,
    ask: Annotated[bool | None, typer.Option("--ask/--no-ask", help="ask for what no flag says")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="print one JSON object and nothing else")] = False,
) -> int:
    """Make a robot of a URDF: choose the joints to plan, find the pairs of links that need no check, write both.

    On a terminal it asks for what no flag says; a plain Enter takes what stands in brackets.

    [bold]Examples[/]

      optiplan robots init my_arm.urdf

      optiplan robots init my_arm.urdf --group j1,j2,j3 --tool tool0 --lock finger=0.02 --limit acceleration=5
    """
    as_json = as_json or bool(context.obj)
    folder = urdf.parent if out is None else out
    _refuse_files(folder, force)
    locked = tuple(_pair("--lock", text, "finger=0.02") for text in lock or ())
    limits = tuple(_limit(*_pair("--limit", text, "acceleration=5")) for text in limit or ())
    choices = Choices(_names(group or ""), tool or "", locked, limits)
    title = name or _title(urdf)
    with stdout_is_ours():
        load = partial(_loaded, urdf, title)
        if sys.stdin.isatty() and not as_json if ask is None else ask:
            choices = _asked(load, choices)
        robot = load(choices)
    _write(urdf, folder, robot, choices)
    _show(robot, folder, as_json)
    return 0


def _refuse_files(folder: Path, force: bool) -> None:
    there = [folder / name for name in (YAML_NAME, SRDF_NAME) if (folder / name).exists()]
    if there and not force:
        found, expected = "a file that is there already", "--force to replace it, or another folder: --out DIR"
        raise InputError([Issue(str(path), None, "robots init", found, expected) for path in there])


def _title(urdf: Path) -> str:
    """The name in the URDF, else that of its file."""
    from optiplan.model.urdf import read_urdf

    read_urdf(urdf, urdf.parent)  # says what is wrong with it, in its own words
    match = re.search(r"<robot\b[^>]*\bname\s*=\s*[\"']([^\"']+)[\"']", urdf.read_text("utf-8", "replace"))
    return urdf.stem if match is None else match[1]


def _names(text: str) -> tuple[str, ...]:
    return tuple(word for word in (part.strip() for part in re.split(r"[,\s]+", text)) if word)


def _pair(flag: str, text: str, example: str) -> tuple[str, float]:
    key, _, value = text.partition("=")
    try:
        return key.strip(), float(value)
    except ValueError:
        raise OptiPlanError(f"{flag}: found '{text}'; expected a name and a number, such as {example}") from None


def _limit(key: str, value: float) -> tuple[str, float]:
    if key not in UNITS:
        raise UnknownChoiceError("limit", key, UNITS)
    if not 0.0 < value < float("inf"):
        raise OptiPlanError(f"limit {key}: found {value:g}; expected a number > 0, in {UNITS[key]}")
    return key, value


def _data(urdf: str, title: str, choices: Choices) -> dict[str, Any]:
    """The robot.yaml as plain data."""
    data: dict[str, Any] = {"version": 1, "name": title, "urdf": urdf}
    if choices.group:
        data["group"] = list(choices.group)
    if choices.tool:
        data["tool_frame"] = choices.tool
    if choices.locked:
        data["locked"] = dict(choices.locked)
    if choices.limits:
        data["limits"] = dict(choices.limits)
    return data


def _loaded(urdf: Path, title: str, choices: Choices) -> "Robot":
    """The robot of a robot.yaml that is not written yet."""
    from optiplan.model.robot import load_robot
    from optiplan.problem.write import problem_text, write_text

    with tempfile.TemporaryDirectory() as made:
        path = Path(made) / YAML_NAME
        write_text(path, problem_text(_data(str(urdf.resolve()), title, choices)))
        try:
            return load_robot(str(path))
        except InputError as error:
            own = str(path.resolve())
            issues = (replace(issue, file="robots init", line=None) for issue in error.issues if issue.file == own)
            others = (issue for issue in error.issues if issue.file != own)
            raise InputError([*issues, *others]) from error


def _asked(load: Callable[[Choices], "Robot"], choices: Choices) -> Choices:
    """The choices after asking for those that no flag made; a wrong name is asked for again."""
    if not choices.group:
        robot = load(choices)
        joints = [name for name in (*robot.joint_names, *robot.locked) if name not in robot.followers]
        choices = replace(choices, group=_ask_names("joints to plan", ",".join(robot.joint_names), joints))
    robot = load(choices)
    frames = [frame.name for frame in robot.model.frames[1:]]
    tool = choices.tool or _ask_names("tool frame", robot.tool_frame, frames)[0]
    locked = dict(choices.locked)
    for joint in (joint for joint in robot.locked if joint not in locked):
        if len(robot.locked) <= MOST_ASKED:
            locked[joint] = typer.prompt(f"{joint} stands at", default=robot.locked[joint], type=float, err=True)
    limits = dict(choices.limits)
    for key in ("acceleration", "jerk"):
        if key not in limits:
            default = float(getattr(robot.limits, key)[0])
            asked = typer.prompt(f"{key} limit of all joints, {UNITS[key]}", default=default, type=float, err=True)
            limits[key] = _limit(key, asked)[1]
    return Choices(choices.group, tool, tuple(locked.items()), tuple(limits.items()))


def _ask_names(what: str, default: str, valid: list[str]) -> tuple[str, ...]:
    while True:
        names = _names(typer.prompt(what, default=default, err=True))
        wrong = [name for name in names if name not in valid]
        if names and not wrong:
            return names
        error = UnknownChoiceError(what, wrong[0] if wrong else "", valid)
        messages().print(str(error), style="red", markup=False, soft_wrap=True)


def _write(urdf: Path, folder: Path, robot: "Robot", choices: Choices) -> None:
    from optiplan.model.srdf import srdf_text
    from optiplan.problem.write import problem_text, write_text

    relative = os.path.relpath(urdf.resolve(), folder.resolve())
    chosen = replace(choices, group=robot.joint_names, tool=robot.tool_frame)
    data = _data(relative, robot.name, chosen) | {"srdf": SRDF_NAME}
    write_text(folder / SRDF_NAME, srdf_text(robot.name, robot.allowed))
    write_text(folder / YAML_NAME, problem_text(data, f"Made by `optiplan robots init {urdf.name}`."))


def _show(robot: "Robot", folder: Path, as_json: bool) -> None:
    from optiplan.cli.robot_table import describe, show_robot

    data = describe(robot) | {"source": str(folder / YAML_NAME)}
    files = [str(folder / YAML_NAME), str(folder / SRDF_NAME)]
    follow = "optiplan plan problem.yaml --view"
    if as_json:
        print_json(data | {"written": files, "next": follow})
        return
    show_robot(results(), data)
    results().print(f"written: {' and '.join(files)}", markup=False, soft_wrap=True)
    line = f"next: {follow}, with the line `robot: {folder / YAML_NAME}` in problem.yaml"
    results().print(line, markup=False, soft_wrap=True)
