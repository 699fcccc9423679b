"""`optiplan robots init`: the choices of the user, by flags or asked for, and the messages."""

import re
import xml.etree.ElementTree as ET
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import typer

from optiplan.api.imports.robot_files import SRDF_NAME, YAML_NAME, Choices
from optiplan.api.init_robot import TOUCHING, checked_limit
from optiplan.arrays import Array
from optiplan.cli.output import print_error, print_json, results, say
from optiplan.cli.printing.robot_table import describe, show_robot
from optiplan.errors import OptiPlanError, UnknownChoiceError
from optiplan.robot.limits import joint_units
from optiplan.robot.robot import Robot
from optiplan.robot.urdf.srdf import LinkPair, link_pair

MOST_ASKED = 8
"""Joints outside the group whose position is asked for; of a hand with forty, all keep theirs."""


def _names(text: str) -> tuple[str, ...]:
    return tuple(word for word in (part.strip() for part in re.split(r"[,\s]+", text)) if word)


def read_choices(group: str, tool: str, lock: Sequence[str], limit: Sequence[str], pairs: str) -> Choices:
    """Parse the choices given by flags.

    Raises:
        OptiPlanError: not a number, not a limit, or no pair of links.
    """
    locked = tuple(_pair("--lock", text, "finger=0.02") for text in lock)
    limits = tuple(checked_limit(*_pair("--limit", text, "acceleration=5")) for text in limit)
    allowed = () if pairs == TOUCHING else tuple(_link_pair(text) for text in _names(pairs))
    return Choices(_names(group), tool, locked, limits, allowed)


def read_arguments(texts: Sequence[str]) -> dict[str, str]:
    """Parse arguments of a xacro file, `NAME=VALUE`, or `NAME:=VALUE` as on the command line of xacro.

    Raises:
        OptiPlanError: no name, or no value.
    """
    arguments = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not (name := name.removesuffix(":").strip()) or not equals:
            raise OptiPlanError(f"--arg: found '{text}'; expected a name and a value, such as ur_type=ur5e")
        arguments[name] = value
    return arguments


def _pair(flag: str, text: str, example: str) -> tuple[str, float]:
    key, _, value = text.partition("=")
    try:
        return key.strip(), float(value)
    except ValueError:
        raise OptiPlanError(f"{flag}: found '{text}'; expected a name and a number, such as {example}") from None


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
            asked = _ask_limit(key, getattr(robot.limits, key), joint_units(key, robot.revolute))
            if asked is not None:
                limits[key] = checked_limit(key, asked)[1]
    return replace(choices, tool=tool, locked=tuple(locked.items()), limits=tuple(limits.items()))


def _ask_limit(key: str, values: Array, unit: str) -> float | None:
    """Ask for a limit of all joints; None: each keeps its own of these values (n,), which are not the same."""
    least, most = float(values.min()), float(values.max())
    if least == most:
        return float(typer.prompt(f"{key} limit of all joints, {unit}", default=least, type=float, err=True))
    kept = f"each its own, {least:g} to {most:g}"
    while True:
        text = typer.prompt(f"{key} limit of all joints, {unit}", default=kept, err=True)
        try:
            return None if text == kept else float(text)
        except ValueError:
            print_error(f"{key}: found '{text}'; expected a number, or a plain Enter")


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
        print_error(str(error))


def show(robot: Robot, folder: Path, as_json: bool, full: bool, imported: Sequence[str] = ()) -> None:
    """Print the files written, remarks of an import, the next command; with `full` every pair of links and frame."""
    data = describe(robot) | {"source": str(folder / YAML_NAME)}
    files = [str(folder / YAML_NAME), str(folder / SRDF_NAME)]
    follow = "optiplan plan problem.yaml --view"
    if as_json:
        print_json(data | {"written": files, "imported": list(imported), "next": follow})
        return
    show_robot(results(), data, full)
    for note in imported:
        say(f"import: {note}")
    say(f"written: {' and '.join(files)}")
    line = f"next: {follow}, with the line `robot: {folder / YAML_NAME}` in problem.yaml"
    say(line)
