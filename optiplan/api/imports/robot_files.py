"""The files of a robot that `init_robot` makes: robot.yaml, robot.srdf, and URDF and meshes of an imported one."""

import os
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from optiplan.errors import InputError, Issue
from optiplan.files import write_bytes, write_text
from optiplan.importers.moveit import CLAMP
from optiplan.importers.robots.description import Description
from optiplan.problem.write import problem_text
from optiplan.records import dataclass
from optiplan.robot.robot import Robot, load_robot
from optiplan.robot.self_collision.pairs import srdf_words
from optiplan.robot.urdf.elements import xml_text
from optiplan.robot.urdf.reader import read_urdf
from optiplan.robot.urdf.ros_packages import UP
from optiplan.robot.urdf.srdf import LinkPair, link_pair, srdf_text

YAML_NAME, SRDF_NAME, URDF_NAME = "robot.yaml", "robot.srdf", "robot.urdf"


@dataclass(frozen=True)
class Choices:
    """Entries of a robot.yaml beside the names of its files; empty means OptiPlan's default."""

    group: tuple[str, ...] = ()
    tool: str = ""
    locked: tuple[tuple[str, float], ...] = ()
    limits: tuple[tuple[str, float], ...] = ()
    allowed: tuple[LinkPair, ...] = ()


@dataclass(frozen=True)
class RobotSource:
    """A robot to be made: what was read of it, the URDF as it lies now, and the name."""

    described: Description
    urdf: Path
    name: str

    def load(self, choices: Choices) -> Robot:
        """Load the robot of a robot.yaml that is not written yet."""
        with _passing_folder() as made:
            path = made / YAML_NAME
            data = _data(str(self.urdf.resolve()), self, choices)
            if "srdf" in data:
                data["srdf"] = str(self.urdf.resolve().parent / data["srdf"])
            write_text(path, problem_text(data))
            try:
                return load_robot(str(path))
            except InputError as error:
                own, source = str(path.resolve()), str(self.described.source)
                issues = (replace(issue, file=source, line=None) for issue in error.issues if issue.file == own)
                others = (issue for issue in error.issues if issue.file != own)
                raise InputError([self._named(issue) for issue in (*issues, *others)]) from error

    def _named(self, issue: Issue) -> Issue:
        """Name a file that was made by what it was made of: where it lies now is nowhere to look."""
        if self.described.urdf is not None:
            return issue
        made, source = str(self.urdf.resolve()), str(self.described.source)
        return replace(issue, file=issue.file.replace(made, source), found=issue.found.replace(made, source))


@contextmanager
def laid_out(described: Description, name: str | None = None) -> Iterator[RobotSource]:
    """Yield a robot with its URDF as a file: the user's own, or one in a folder that is removed in the end."""
    if described.urdf is not None:
        yield RobotSource(described, described.urdf, name or described.name)
        return
    with _passing_folder() as made:
        for file, content in described.files.items():
            write_bytes(made / file, content)
        write_text(made / URDF_NAME, described.text)
        yield RobotSource(described, made / URDF_NAME, name or described.name)


@contextmanager
def _passing_folder() -> Iterator[Path]:
    """Yield a folder that is removed in the end, so deep that no package is looked for beside it."""
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made).joinpath(*["made"] * UP)
        folder.mkdir(parents=True)
        yield folder


def refuse_files(folder: Path, force: bool, described: Description | None = None) -> None:
    """Raise an `InputError` for existing files that must not be replaced."""
    names = [YAML_NAME, SRDF_NAME]
    if described is not None and described.urdf is None:
        names += [URDF_NAME, *described.files]
    there = [folder / name for name in names if (folder / name).exists()]
    if there and not force:
        found, expected = "a file that is there already", "--force to replace it, or another folder: --out DIR"
        raise InputError([Issue(str(path), None, "robots init", found, expected) for path in there])


def at_rest(source: RobotSource, robot: Robot, choices: Choices) -> Choices:
    """Add the positions at which the source has joints that are not planned, where no choice names them."""
    given = dict(choices.locked)
    rest = {joint: q for joint, q in source.described.rest.items() if joint in robot.locked and joint not in given}
    return replace(choices, locked=tuple({**rest, **given}.items()))


def write_robot(source: RobotSource, folder: Path, robot: Robot, choices: Choices) -> list[str]:
    """Write URDF and meshes of an imported robot, the SRDF and at last the robot.yaml; return what its head says.

    The robot.yaml has the joints and the tool frame, the SRDF the names of the URDF. The former does not name the
    latter: its pairs hold for these joints, limits and locked values only, and where a problem chooses others they are
    found anew.
    """
    described = source.described
    if described.urdf is None:
        for file, content in described.files.items():
            write_bytes(folder / file, content)
        write_text(folder / URDF_NAME, _with_relative_meshes(described.text, folder))
        urdf = URDF_NAME
    else:
        urdf = os.path.relpath(source.urdf.resolve(), folder.resolve())
    chosen = choices
    if "groups" not in described.keys or choices.group:
        chosen = replace(choices, group=robot.joint_names, tool=robot.tool_frame)
    data = _data(urdf, source, chosen)
    notes = [*described.notes, *_unplanned_limits(described.limits, data)]
    if states := _states(source, robot, notes):
        data["configurations"] = states
    comment = "\n".join([f"Made by `optiplan robots init {described.source.name}`.", *notes])
    own = {new: old for old, new in read_urdf(source.urdf, source.urdf.parent).renamed.items()}
    pairs = srdf_words(robot.allowed).items()
    words = {link_pair(*(own.get(link, link) for link in pair)): word for pair, word in pairs}
    write_text(folder / SRDF_NAME, srdf_text(robot.name, words))
    write_text(folder / YAML_NAME, problem_text(data, comment))
    return notes


def _with_relative_meshes(text: str, folder: Path) -> str:
    """The URDF with paths from its folder in the place of absolute ones."""
    root = ET.fromstring(text)
    for mesh in root.iter("mesh"):
        if Path(mesh.get("filename", "")).is_absolute():
            mesh.set("filename", os.path.relpath(mesh.get("filename", ""), folder.resolve()))
    return xml_text(root)


def _states(source: RobotSource, robot: Robot, notes: list[str]) -> dict[str, dict[str, float]]:
    """The named configurations of the source that give every planned joint a position within its limits.

    Values that rounding took out of their limits are put on them. Others are left out with a note, but for those that
    give no planned joint a position: they are of another group.
    """
    names, lower, upper = robot.joint_names, robot.limits.lower, robot.limits.upper
    found: dict[str, dict[str, float]] = {}
    for name, state in source.described.states.items():
        missing = [joint for joint in names if joint not in state]
        if missing:
            if len(missing) < len(names):
                notes.append(f"left out: configuration {name}, which gives no position of {', '.join(missing)}")
            continue
        values = np.array([state[joint] for joint in names])
        inside = np.clip(values, lower, upper)
        far = [joint for joint, off in zip(names, np.abs(values - inside), strict=True) if not off <= CLAMP]
        if far:
            notes.append(f"left out: configuration {name}, in which {', '.join(far)} is beyond its limits")
            continue
        if moved := [joint for joint, a, b in zip(names, values, inside, strict=True) if a != b]:
            notes.append(f"configuration {name} has {', '.join(moved)} beyond limits by rounding: moved to the limit")
        found[name] = dict(zip(names, inside.tolist(), strict=True))
    return found


def _data(urdf: str, source: RobotSource, choices: Choices) -> dict[str, Any]:
    """The robot.yaml as plain data."""
    described = source.described
    data: dict[str, Any] = {"version": 1, "name": source.name, "urdf": urdf, **described.keys}
    if choices.group:
        data["group"] = list(choices.group)
    if choices.tool:
        data["tool_frame"] = choices.tool
    if choices.locked:
        data["locked"] = dict(choices.locked)
    if limits := _limits(described.limits, data) | dict(choices.limits):
        data["limits"] = limits
    if allowed := sorted({*described.allowed, *choices.allowed}):
        data["allowed_collisions"] = [list(pair) for pair in allowed]
    return data


def _limits(stated: Mapping[str, Mapping[str, float]], data: Mapping[str, Any]) -> dict[str, Any]:
    """The limits that the source states for joints of some group."""
    listed = _listed(data)
    kept = {key: {joint: x for joint, x in values.items() if joint in listed} for key, values in stated.items()}
    return {key: values for key, values in kept.items() if values}


def _unplanned_limits(stated: Mapping[str, Mapping[str, float]], data: Mapping[str, Any]) -> Iterator[str]:
    """Name the joints whose limits the source states and no group plans."""
    if others := sorted({joint for values in stated.values() for joint in values} - _listed(data)):
        yield f"left out: limits of rates of joints in no group, {', '.join(others)}"


def _listed(data: Mapping[str, Any]) -> set[str]:
    """The joints of all groups of a robot.yaml."""
    return {*data.get("group", ()), *(joint for joints in data.get("groups", {}).values() for joint in joints)}
