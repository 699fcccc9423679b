"""`init_robot`: from a URDF or a robot of another program to a robot.yaml and the pairs that need no check."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from optiplan.api.imports.robot_files import (
    YAML_NAME,
    Choices,
    RobotSource,
    at_rest,
    laid_out,
    refuse_files,
    write_robot,
)
from optiplan.arrays import number_argument
from optiplan.errors import (
    OptiPlanError,
    UnknownChoiceError,
    described,
    flag_argument,
    path_argument,
    progress_argument,
    text_argument,
    words_of_call,
    wrong_argument,
)
from optiplan.files import folder_of
from optiplan.importers.robots.describe import describe
from optiplan.planners.base import Progress, silent
from optiplan.robot.limits import DEFAULTS, joint_units
from optiplan.robot.robot import Robot, load_robot
from optiplan.robot.urdf.srdf import link_pair
from optiplan.verify.continuous.kept_clearance import prove_kept_clearances as prove

_WORDS = {"--force": "replace_files=True", "--out DIR": "`out`", "--arg NAME=VALUE": "`arguments`"}
"""Options of the command line, and the arguments in their place."""

TOUCHING = "touching"


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
    arguments: Mapping[str, str] | None = None,
    replace_files: bool = False,
    progress: Progress | None = None,
) -> Robot:
    """Make a robot of a URDF, or import one: find the pairs of links that need no check, write robot.yaml, robot.srdf.

    What `optiplan robots init URDF --no-ask` does. The robot.yaml names the joints, the tool frame and what is given
    here; the rest is OptiPlan's defaults, and `Robot.notes` says what was assumed. Of a robot of another program
    robot.urdf is written too, with the meshes of MJCF and USD; those of xacro and MoveIt stay where they are. The head
    of the robot.yaml says what was left out.

    Args:
        urdf: the path of a URDF, a xacro file, MuJoCo's MJCF, a USD stage, or a MoveIt configuration folder; meshes are
            looked for beside it.
        out: folder for the files; None: that of the URDF, or the configuration folder.
        name: of the robot; None: that in the URDF.
        group: names of the joints to plan, base to tip; none: the longest chain.
        tool_frame: the frame that goals are for; empty: a link behind the last planned joint.
        locked: positions of joints that are not planned, rad or m.
        limits: of all joints, such as `{"acceleration": 5.0}`, rad/s² (m/s² of sliding joints).
        allow_pairs: pairs of links not to check, or `"touching"`: those that touch in more than a fifth of all
            configurations, since they overlap as they are built.
        arguments: of a xacro file, by name, such as `{"ur_type": "ur5e"}`; others have the defaults of the file.
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
    folder = folder_of(path) if out is None else path_argument("init_robot", "out", out, "the path of a folder")
    text_argument("init_robot", "name", name, "the name of the robot")
    text_argument("init_robot", "tool_frame", tool_frame, "the name of a link or fixed frame")
    flag_argument("init_robot", "replace_files", replace_files)
    progress_argument("init_robot", progress)
    told = progress or silent
    for argument, given in (("locked", locked), ("limits", limits), ("arguments", arguments)):
        if given is not None and not isinstance(given, Mapping):
            raise wrong_argument("init_robot", argument, described(given), "values by name, such as {'name': 0.1}")
    texts = {str(key): str(value) for key, value in (arguments or {}).items()}
    if not (allow_pairs == TOUCHING if isinstance(allow_pairs, str) else _are_pairs(allow_pairs)):
        expected = f"'{TOUCHING}', or pairs of links such as [('link_4', 'link_6')]"
        raise wrong_argument("init_robot", "allow_pairs", described(allow_pairs), expected)
    if not isinstance(group, Sequence) or isinstance(group, str) or not all(isinstance(joint, str) for joint in group):
        raise wrong_argument("init_robot", "group", described(group), "names of joints, base to tip")
    for joint, q in (locked or {}).items():
        number_argument("init_robot", f"locked[{joint!r}]", q, "a finite number, rad or m")
    for key, value in (limits or {}).items():
        number_argument("init_robot", f"limits[{key!r}]", value, "a finite number > 0")
    checked = tuple(checked_limit(key, value) for key, value in (limits or {}).items())
    with words_of_call("op.init_robot", _WORDS):
        refuse_files(folder, replace_files)
    pairs = () if isinstance(allow_pairs, str) else tuple(link_pair(*pair) for pair in allow_pairs)
    choices = Choices(tuple(group), tool_frame, tuple((locked or {}).items()), checked, pairs)
    told("reading the robot", 0.0)
    with words_of_call("op.init_robot", _WORDS):
        read = describe(path, texts)
        refuse_files(folder, replace_files, read)
    with laid_out(read, name) as source:
        robot, choices = prepare(source, choices, allow_pairs == TOUCHING, told)
        write_robot(source, folder, robot, choices)
    return load_robot(str(folder / YAML_NAME))


def _are_pairs(value: object) -> bool:
    """Return whether this is a list of pairs of names."""
    return isinstance(value, Sequence) and all(
        isinstance(pair, Sequence) and len(pair) == 2 and all(isinstance(name, str) for name in pair) for pair in value
    )


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


def prepare(source: RobotSource, choices: Choices, touching: bool, progress: Progress) -> tuple[Robot, Choices]:
    """Load the robot, without the pairs of links that are to be allowed, and prove what is kept of the others.

    Args:
        source: the robot to be made.
        choices: of the user.
        touching: whether those are to be allowed that touch in more than `OFTEN` of the configurations.
        progress: of the work.
    """
    progress("reading meshes and pairs of links", 0.0)
    robot = source.load(choices)
    at_once, choices = choices, at_rest(source, robot, choices)
    robot = robot if choices == at_once else source.load(choices)
    if touching:
        progress("pairs of links without those that touch", 0.5)
        choices = replace(choices, allowed=tuple(robot.survey.often_touching(robot.allowed)))
        robot = source.load(choices) if choices.allowed else robot
    prove(robot, lambda pair, share: progress(f"proving {pair}", 0.5 + 0.5 * share))
    return robot, choices
