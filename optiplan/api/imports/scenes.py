"""`import_scene`: a scene of another program as a problem file."""

from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

from optiplan.api.loading import load_robot
from optiplan.errors import InputError, Issue, described, flag_argument, path_argument, words_of_call, wrong_argument
from optiplan.files import write_bytes, write_text
from optiplan.importers.scenes.imported import ImportedScene
from optiplan.importers.scenes.read import read_scene
from optiplan.problem.load import load_problem
from optiplan.problem.problem import Problem
from optiplan.problem.write import problem_text
from optiplan.robot.frames import link_names
from optiplan.robot.reference import robot_names
from optiplan.robot.robot import Robot


def import_scene(source: Path | str, out: Path | str, robot: Path | str, *, replace_files: bool = False) -> Problem:
    """Write the scene of another program as a problem file, with meshes beside it; start and goal are to be edited.

    What `optiplan import scene SOURCE OUT` does. The robot stands at the origin of the scene; start and goal are its
    first and its last named configuration, else the middle of its limits. The head of the file says what was left out.

    Args:
        source: a `.scene` of MoveIt, an SDF world or model, MJCF of MuJoCo (extra `sim`), or a USD stage (extra `usd`).
        out: the problem file to be written.
        robot: a name of `op.robots()`, or the path of a robot.yaml.
        replace_files: whether files that are there are replaced.

    Returns:
        The problem, loaded from the file.

    Raises:
        InputError: the source or the robot cannot be used, a file is there already, or the robot touches the scene
            where it starts; the file is written then, to be edited.
        OptiPlanError: MJCF without the package `mujoco`, USD without `usd-core`.

    Example:
        >>> import optiplan as op
        >>> op.import_scene("cell.sdf", "cell.yaml", "panda")  # doctest: +SKIP
        Problem: cell, panda, to a configuration; table, bin, camera
    """
    path = path_argument("import_scene", "source", source, "the path of a scene")
    target = path_argument("import_scene", "out", out, "the path of a problem file")
    if not isinstance(robot, str | Path):
        expected = "the name of a robot of op.robots(), or the path of a robot.yaml"
        raise wrong_argument("import_scene", "robot", described(robot), expected)
    flag_argument("import_scene", "replace_files", replace_files)
    scene = read_scene(path)
    words = words_of_call("op.import_scene", {"--force": "replace_files=True", "another name": "another `out`"})
    write_scene(scene, target, robot, replace_files, words)
    return load_problem(target)


def write_scene(
    scene: ImportedScene, target: Path, robot: Path | str, force: bool, words: AbstractContextManager[None]
) -> None:
    """Write a scene as a problem file, with meshes beside it; obstacles called like a link or the world are renamed.

    Args:
        scene: what is written.
        target: the problem file.
        robot: its name or file.
        force: whether files that are there are replaced.
        words: what of the caller's is said where one is there and not to be replaced, such as `words_of_call`.

    Raises:
        InputError: the robot cannot be used, or files are there that are not to be replaced.
    """
    there = [path for path in (target, *(target.parent / file for file in scene.files)) if path.exists()]
    if there and not force:
        found, expected = "a file that is there already", "--force to replace it, or another name"
        with words:
            raise InputError([Issue(str(path), None, "import scene", found, expected) for path in there])
    loaded = load_robot(robot)
    for file, content in scene.files.items():
        write_bytes(target.parent / file, content)
    reference = str(robot) if str(robot) in robot_names() else str(Path(robot).resolve())
    scene.rename(link_names(loaded.model))
    ends = _ends(loaded)
    data = {
        "version": 1,
        "name": target.stem,
        "robot": reference,
        "start": {"joints": ends[0]},
        "goal": {"joints": ends[-1]},
        "scene": {"obstacles": scene.obstacles},
    }
    comment = [f"Made by `optiplan import scene {scene.source.name}`: start and goal are to be edited.", *scene.notes]
    write_text(target, problem_text(data, "\n".join(comment)))


def _ends(robot: Robot) -> list[list[float]]:
    """The named configurations, else the middle of the limits, 0 for joints without an end."""
    named: list[list[float]] = [[float(x) for x in q] for q in robot.configurations.values()]
    bounds: Any = zip(robot.limits.lower, robot.limits.upper, strict=True)
    middle = [0.0 if high - low == float("inf") else 0.5 * float(low + high) for low, high in bounds]
    return named or [middle]
