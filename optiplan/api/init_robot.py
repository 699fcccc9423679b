"""`init_robot`: from a URDF to a robot.yaml and the SRDF of the pairs that need no check."""

import os
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from optiplan.arrays import is_finite
from optiplan.errors import (
    InputError,
    Issue,
    OptiPlanError,
    UnknownChoiceError,
    described,
    flag_argument,
    path_argument,
    progress_argument,
    text_argument,
    wrong_argument,
)
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


@dataclass(frozen=True)
class Choices:
    """Entries of a robot.yaml beside the names of its files; empty means OptiPlan's default."""

    group: tuple[str, ...] = ()
    tool: str = ""
    locked: tuple[tuple[str, float], ...] = ()
    limits: tuple[tuple[str, float], ...] = ()
    allowed: tuple[LinkPair, ...] = ()


def init_robot(  # noqa: PLR0913  # one keyword for each flag of the command
    urdf: Path | str,
    out: Path | str | None = None,
    *,
    name: str | None = None,
    group: Sequence[str] = (),
    tool_frame: str = "",
    locked: Mapping[str, float] | None = None,
    limits: Mapping[str, float] | None = None,
    allow_pairs: str | Sequence[tuple[str, str]] = (),
    replace_files: bool = False,
    progress: Progress = lambda stage, fraction: None,
) -> Robot:
    """Make a robot of a URDF: find the pairs of links that need no check, and write robot.yaml and robot.srdf.

    What `optiplan robots init URDF --no-ask` does. The robot.yaml names the joints, the tool frame and what is given
    here; the rest is OptiPlan's defaults, and `Robot.notes` says what was assumed.

    Args:
        urdf: the path of the URDF; meshes are looked for beside it.
        out: folder for the files; None: that of the URDF.
        name: of the robot; None: that in the URDF.
        group: names of the joints to plan, base to tip; none: the longest chain.
        tool_frame: the frame that goals are for; empty: a link behind the last planned joint.
        locked: positions of joints that are not planned, rad or m.
        limits: of all joints, such as `{"acceleration": 5.0}`, rad/s² (m/s² of sliding joints).
        allow_pairs: pairs of links not to check, or `"touching"`: those that touch in more than a fifth of all
            configurations, since they overlap as they are built.
        replace_files: whether files that are there are replaced.
        progress: called with the name of a stage and the fraction done.

    Returns:
        The robot, loaded from the file that was written.

    Raises:
        InputError: the URDF or its meshes cannot be used, a file is there already, an argument does not fit.
        OptiPlanError: no such limit or link.

    Example:
        >>> import optiplan as op
        >>> op.init_robot("my_arm.urdf", "my_arm", limits={"acceleration": 5.0})  # doctest: +SKIP
        Robot: my_arm, 6 joints, tool frame tool0, configurations: none
          joints: joint_1, joint_2, joint_3, joint_4, joint_5, joint_6
    """
    path = path_argument("init_robot", "urdf", urdf, "the path of a URDF")
    folder = path.parent if out is None else path_argument("init_robot", "out", out, "the path of a folder")
    text_argument("init_robot", "name", name, "the name of the robot")
    text_argument("init_robot", "tool_frame", tool_frame, "the name of a link or fixed frame")
    flag_argument("init_robot", "replace_files", replace_files)
    progress_argument("init_robot", progress)
    for argument, given in (("locked", locked), ("limits", limits)):
        if given is not None and not isinstance(given, Mapping):
            raise wrong_argument("init_robot", argument, described(given), "values by name, such as {'name': 0.1}")
    if not isinstance(allow_pairs, str) and not _are_pairs(allow_pairs):
        expected = f"'{TOUCHING}', or pairs of links such as [('link_4', 'link_6')]"
        raise wrong_argument("init_robot", "allow_pairs", described(allow_pairs), expected)
    if not isinstance(group, Sequence) or isinstance(group, str) or not all(isinstance(joint, str) for joint in group):
        raise wrong_argument("init_robot", "group", described(group), "names of joints, base to tip")
    for joint, q in (locked or {}).items():
        if not is_finite(q):
            raise wrong_argument("init_robot", f"locked[{joint!r}]", described(q), "a finite number, rad or m")
    for key, value in (limits or {}).items():
        if not is_finite(value):
            raise wrong_argument("init_robot", f"limits[{key!r}]", described(value), "a finite number > 0")
    checked = tuple(checked_limit(key, value) for key, value in (limits or {}).items())
    refuse_files(folder, replace_files)
    pairs = () if isinstance(allow_pairs, str) else tuple(link_pair(*pair) for pair in allow_pairs)
    if isinstance(allow_pairs, str) and allow_pairs != TOUCHING:
        expected = f"'{TOUCHING}', or pairs of links such as [('link_4', 'link_6')]"
        raise wrong_argument("init_robot", "allow_pairs", described(allow_pairs), expected)
    choices = Choices(tuple(group), tool_frame, tuple((locked or {}).items()), checked, pairs)
    load = partial(load_choices, path, name or title_of(path))
    robot, choices = prepare(load, choices, allow_pairs == TOUCHING, progress)
    write_robot(path, folder, robot, choices)
    return load_robot(str(folder / YAML_NAME))


def _are_pairs(value: object) -> bool:
    """Return whether this is a list of pairs of names."""
    return isinstance(value, Sequence) and all(
        isinstance(pair, Sequence) and len(pair) == 2 and all(isinstance(name, str) for name in pair) for pair in value
    )


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


def checked_limit(key: str, value: float) -> tuple[str, float]:
    """Return a limit of all joints.

    Raises:
        OptiPlanError: there is none of that name, or the value is not above 0.
    """
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


def load_choices(urdf: Path, title: str, choices: Choices) -> Robot:
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
    load: Callable[[Choices], Robot], choices: Choices, touching: bool, progress: Progress
) -> tuple[Robot, Choices]:
    """Load the robot, without the pairs of links that are to be allowed, and prove what is kept of the others.

    Args:
        load: the robot of these choices.
        choices: of the user.
        touching: whether those are to be allowed that touch in more than `OFTEN` of the configurations.
        progress: of the work.
    """
    progress("reading meshes and pairs of links", 0.0)
    robot = load(choices)
    if touching:
        progress("pairs of links without those that touch", 0.5)
        choices = replace(choices, allowed=tuple(robot.survey.often_touching(robot.allowed)))
        robot = load(choices) if choices.allowed else robot
    prove(robot, lambda pair, share: progress(f"proving {pair}", 0.5 + 0.5 * share))
    return robot, choices


def write_robot(urdf: Path, folder: Path, robot: Robot, choices: Choices) -> None:
    """Write the SRDF and then the robot.yaml, with the joints and the tool frame that were chosen.

    The robot.yaml does not name the SRDF: its pairs hold for these joints, limits and locked values only, and where a
    problem chooses others they are found anew.
    """
    relative = os.path.relpath(urdf.resolve(), folder.resolve())
    chosen = replace(choices, group=robot.joint_names, tool=robot.tool_frame)
    data = _data(relative, robot.name, chosen)
    write_text(folder / SRDF_NAME, srdf_text(robot.name, robot.allowed))
    write_text(folder / YAML_NAME, problem_text(data, f"Made by `optiplan robots init {urdf.name}`."))
