"""Make a robot.yaml and an SRDF from a URDF: the user's choices, the files, and the messages."""

import os
import re
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import typer

from optiplan.cli.output import messages, print_json, results
from optiplan.cli.printing.robot_table import describe, show_robot, touching_pairs
from optiplan.errors import InputError, Issue, OptiPlanError, UnknownChoiceError
from optiplan.files import write_text
from optiplan.planners.base import Progress
from optiplan.problem.write import problem_text
from optiplan.robot.limits import DEFAULTS, joint_units
from optiplan.robot.robot import Robot, load_robot
from optiplan.robot.urdf.reader import read_urdf
from optiplan.robot.urdf.srdf import LinkPair, link_pair, srdf_text
from optiplan.verify.continuous.kept_clearance import prove_kept_clearances as prove

YAML_NAME, SRDF_NAME = "robot.yaml", "robot.srdf"
TOUCHING = "touching"
MOST_ASKED = 8
"""Joints outside the group whose position is asked for; of a hand with forty, all keep theirs."""


@dataclass(frozen=True)
class Choices:
    """Entries of a robot.yaml beside the names of its files; empty means OptiPlan's default."""

    group: tuple[str, ...] = ()
    tool: str = ""
    locked: tuple[tuple[str, float], ...] = ()
    limits: tuple[tuple[str, float], ...] = ()
    allowed: tuple[LinkPair, ...] = ()


def refuse_files(folder: Path, force: bool) -> None:
    """Raise an `InputError` for existing files that must not be replaced."""
    there = [folder / name for name in (YAML_NAME, SRDF_NAME) if (folder / name).exists()]
    if there and not force:
        found, expected = "a file that is there already", "--force to replace it, or another folder: --out DIR"
        raise InputError([Issue(str(path), None, "robots init", found, expected) for path in there])


def title_of(urdf: Path) -> str:
    """Return the name in the URDF, else that of its file.

    Raises:
        InputError: not a URDF, or one that is not supported.
    """
    return ET.fromstring(read_urdf(urdf, urdf.parent).xml).get("name") or urdf.stem


def read_choices(group: str, tool: str, lock: Sequence[str], limit: Sequence[str]) -> Choices:
    """Parse the choices given by flags.

    Raises:
        OptiPlanError: not a number, or not a limit.
    """
    locked = tuple(_pair("--lock", text, "finger=0.02") for text in lock)
    limits = tuple(_limit(*_pair("--limit", text, "acceleration=5")) for text in limit)
    return Choices(_names(group), tool, locked, limits)


def _names(text: str) -> tuple[str, ...]:
    return tuple(word for word in (part.strip() for part in re.split(r"[,\s]+", text)) if word)


def _pair(flag: str, text: str, example: str) -> tuple[str, float]:
    key, _, value = text.partition("=")
    try:
        return key.strip(), float(value)
    except ValueError:
        raise OptiPlanError(f"{flag}: found '{text}'; expected a name and a number, such as {example}") from None


def _limit(key: str, value: float) -> tuple[str, float]:
    if key not in DEFAULTS:
        raise UnknownChoiceError("limit", key, DEFAULTS)
    if not 0.0 < value < float("inf"):
        raise OptiPlanError(f"limit {key}: found {value:g}; expected a number > 0, in {joint_units(key)}")
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
    if choices.allowed:
        data["allowed_collisions"] = [list(pair) for pair in choices.allowed]
    return data


def load(urdf: Path, title: str, choices: Choices) -> Robot:
    """Load the robot of a robot.yaml that is not written yet."""
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


def prepare(
    load: Callable[[Choices], Robot], choices: Choices, pairs: str, progress: Progress
) -> tuple[Robot, Choices]:
    """Load the robot, without the pairs of links that are to be allowed, and prove what is kept of the others.

    Args:
        load: the robot of these choices.
        choices: of the user.
        pairs: `touching`, those that touch in more than `OFTEN` of the configurations; or names, A:B,C:D.
        progress: of the work.

    Raises:
        OptiPlanError: what is no pair of links.
    """
    progress("reading meshes and pairs of links", 0.0)
    if pairs and pairs != TOUCHING:
        choices = replace(choices, allowed=tuple(_link_pair(text) for text in _names(pairs)))
    robot = load(choices)
    if pairs == TOUCHING:
        progress("pairs of links without those that touch", 0.5)
        choices = replace(choices, allowed=tuple(touching_pairs(robot)))
        robot = load(choices) if choices.allowed else robot
    prove(robot, lambda pair, share: progress(f"proving {pair}", 0.5 + 0.5 * share))
    return robot, choices


def _link_pair(text: str) -> LinkPair:
    first, colon, second = text.partition(":")
    if not (first and colon and second):
        expected = f"`{TOUCHING}`, or two links with a colon between them, such as link_4:link_6"
        raise OptiPlanError(f"--allow-pairs: found '{text}'; expected {expected}")
    return link_pair(first, second)


def ask(load: Callable[[Choices], Robot], choices: Choices) -> Choices:
    """Prompt for the choices not given by flags; repeat for an invalid name."""
    if not choices.group:
        robot = load(choices)
        joints = [name for name in (*robot.joint_names, *robot.locked) if name not in _following(robot)]
        choices = replace(choices, group=_ask_names("joints to plan", ",".join(robot.joint_names), joints))
    robot = load(choices)
    frames = [frame.name for frame in robot.model.frames[1:]]
    tool = choices.tool or _ask_names("tool frame", robot.tool_frame, frames)[0]
    locked = dict(choices.locked)
    others = [joint for joint in robot.locked if joint not in locked and joint not in _following(robot)]
    for joint in others:
        if len(others) <= MOST_ASKED:
            locked[joint] = typer.prompt(f"{joint} stands at", default=robot.locked[joint], type=float, err=True)
    limits = dict(choices.limits)
    for key in ("acceleration", "jerk"):
        if key not in limits:
            default = float(getattr(robot.limits, key)[0])
            unit = joint_units(key, robot.revolute)
            asked = typer.prompt(f"{key} limit of all joints, {unit}", default=default, type=float, err=True)
            limits[key] = _limit(key, asked)[1]
    return replace(choices, tool=tool, locked=tuple(locked.items()), limits=tuple(limits.items()))


def _following(robot: Robot) -> set[str | None]:
    """Return the mimic joints of the URDF."""
    return {joint.get("name") for joint in ET.fromstring(robot.urdf).iter("joint") if joint.find("mimic") is not None}


def _ask_names(what: str, default: str, valid: list[str]) -> tuple[str, ...]:
    while True:
        names = _names(typer.prompt(what, default=default, err=True))
        wrong = [name for name in names if name not in valid]
        if names and not wrong:
            return names
        error = UnknownChoiceError(what, wrong[0] if wrong else "", valid)
        messages().print(str(error), style="red", markup=False, soft_wrap=True)


def write(urdf: Path, folder: Path, robot: Robot, choices: Choices) -> None:
    """Write the SRDF and then the robot.yaml, with the joints and the tool frame that were chosen.

    The robot.yaml does not name the SRDF: its pairs hold for these joints, limits and locked values only, and where a
    problem chooses others they are found anew.
    """
    relative = os.path.relpath(urdf.resolve(), folder.resolve())
    chosen = replace(choices, group=robot.joint_names, tool=robot.tool_frame)
    data = _data(relative, robot.name, chosen)
    write_text(folder / SRDF_NAME, srdf_text(robot.name, robot.allowed))
    write_text(folder / YAML_NAME, problem_text(data, f"Made by `optiplan robots init {urdf.name}`."))


def show(robot: Robot, folder: Path, as_json: bool, full: bool) -> None:
    """Print the files written and the next command; with `full` every pair of links and every frame."""
    data = describe(robot) | {"source": str(folder / YAML_NAME)}
    files = [str(folder / YAML_NAME), str(folder / SRDF_NAME)]
    follow = "optiplan plan problem.yaml --view"
    if as_json:
        print_json(data | {"written": files, "next": follow})
        return
    show_robot(results(), data, full)
    results().print(f"written: {' and '.join(files)}", markup=False, soft_wrap=True)
    line = f"next: {follow}, with the line `robot: {folder / YAML_NAME}` in problem.yaml"
    results().print(line, markup=False, soft_wrap=True)
