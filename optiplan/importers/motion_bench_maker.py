"""Import of MotionBenchMaker data sets: MoveIt scene and request files, two by two, into problem files."""

import re
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from optiplan.config.messages import choices
from optiplan.errors import InputError, Issue
from optiplan.files import write_text
from optiplan.importers.moveit import convert, merged_state
from optiplan.importers.moveit_objects import CannotConvert
from optiplan.problem.schema.problem import ProblemSpec
from optiplan.problem.write import problem_text
from optiplan.records import dataclass
from optiplan.robot.robot import Robot, load_robot, robot_names

FILE_NAME = re.compile(r"(?P<before>.*?)(?P<kind>scene|request)(?P<after>.*)\.ya?ml", re.IGNORECASE)
"""`scene0001.yaml` and `request0001.yaml`, `0001_scene.yaml` and `0001_request.yaml`, …: alike but for the one word."""


@dataclass(frozen=True)
class ImportSummary:
    """Files written by an import, what it left out and why, and remarks with the number of problems concerned."""

    written: tuple[Path, ...]
    skipped: tuple[tuple[Path, str], ...]
    notes: tuple[tuple[str, int], ...]


def import_mbm(directory: Path | str, out: Path | str, robot: str | None = None) -> ImportSummary:
    """Convert every scene/request pair below `directory` into a problem file below `out`, folder by folder.

    Args:
        directory: holds `scene*.yaml` and `request*.yaml`, at any depth.
        out: gets `<folder>/<number>.yaml`, and meshes beside them.
        robot: a name of `robots/` or the path of a robot file; without it, the `robot_model_name` of each scene.

    Raises:
        InputError: `directory` is no folder or holds no pair, the robot file cannot be used, or no robot is given and a
            scene is of an unknown one.
        UnknownChoiceError: no robot of the name given.
    """
    root, target = Path(directory), Path(out)
    pairs, skipped = find_pairs(root)
    if not pairs:
        found = "no pair of scene and request files" if root.is_dir() else "no folder"
        raise InputError([Issue(str(root), None, "directory", found, "a folder with scene*.yaml and request*.yaml")])
    importer = Importer(robot)
    written: list[Path] = []
    for scene, request in pairs:
        try:
            written.append(importer.write(scene, request, target / scene.parent.relative_to(root)))
        except CannotConvert as error:
            skipped.append((request, str(error)))
    return ImportSummary(tuple(written), tuple(sorted(skipped)), tuple(importer.notes.items()))


def find_pairs(root: Path) -> tuple[list[tuple[Path, Path]], list[tuple[Path, str]]]:
    """Scene and request files that belong together, in order, and those that have no partner, with the reason."""
    kinds: dict[str, dict[tuple[Path, str, str], Path]] = {"scene": {}, "request": {}}
    for path in sorted(root.rglob("*.y*ml")):
        match = FILE_NAME.fullmatch(path.name)
        if match:
            kinds[match["kind"].lower()][path.parent, match["before"], match["after"]] = path
    scenes, requests = kinds["scene"], kinds["request"]
    alone = [(scenes[key], "no request file of this number") for key in scenes.keys() - requests.keys()]
    alone += [(requests[key], "no scene file of this number") for key in requests.keys() - scenes.keys()]
    return [(path, requests[key]) for key, path in scenes.items() if key in requests], alone


class Importer:
    """Converts pairs of files; loads each robot once and counts remarks in `notes`."""

    def __init__(self, robot: str | None) -> None:
        """Take a name of `robots/` or the path of a robot file; None: the `robot_model_name` of each scene."""
        self.reference = robot
        self.notes: Counter[str] = Counter()
        self._robots: dict[tuple[str, tuple[tuple[str, float], ...]], Robot] = {}

    def write(self, scene_file: Path, request_file: Path, folder: Path) -> Path:
        """Convert one pair and write it below `folder`."""
        data, meshes = self.convert(scene_file, request_file)
        for file, text in meshes.items():
            write_text(folder / file, text)
        path = folder / f"{number_of(request_file)}.yaml"
        write_text(path, problem_text(data, f"Converted from {scene_file.name} and {request_file.name}."))
        return path

    def convert(self, scene_file: Path, request_file: Path) -> tuple[dict[str, Any], dict[str, str]]:
        """The content of a problem file, and of the mesh files beside it, by name.

        Raises:
            CannotConvert: something is missing or has no counterpart in a problem file.
            InputError, UnknownChoiceError: the robot cannot be used.
        """
        scene, request = _read(scene_file), _read(request_file)
        number = number_of(request_file)
        try:
            robot = self._robot(scene, request, scene_file)
            converted = convert(scene, request, robot, number)
        except CannotConvert:
            raise
        except (LookupError, TypeError, AttributeError, ValueError, OverflowError) as error:  # files of another kind
            raise CannotConvert(f"not a MoveIt scene and request: {type(error).__name__} {error}") from error
        shipped = self.reference is None or self.reference in robot_names()
        reference = robot.source.parent.name if shipped else str(robot.source)
        name = f"{scene_file.resolve().parent.name}/{number}"
        data = {"version": 1, "name": name, "robot": reference, **converted.data}
        _check(data)
        kept = [note for note in robot.notes if any(note.startswith(f"joint {j} ") for j in data.get("locked", {}))]
        self.notes.update(dict.fromkeys(converted.notes + kept, 1))
        return data, converted.meshes

    def _robot(self, scene: Mapping[str, Any], request: Mapping[str, Any], scene_file: Path) -> Robot:
        """The robot with the joints outside its group where the two files put them."""
        name = str(scene.get("robot_model_name", ""))
        reference = self.reference or name.lower()
        if self.reference is None and reference not in robot_names():
            expected = f"{choices(reference, robot_names())}, or the robot to be used instead (--robot)"
            raise InputError([Issue(str(scene_file), None, "robot_model_name", f"'{name}'", expected)])
        plain = self._loaded(reference, {})
        state = merged_state(scene, request)
        return self._loaded(reference, {joint: state[joint] for joint in state if joint in plain.locked})

    def _loaded(self, reference: str, locked: Mapping[str, float]) -> Robot:
        key = (reference, tuple(sorted(locked.items())))
        if key not in self._robots:
            self._robots[key] = load_robot(reference, Path.cwd(), locked)
        return self._robots[key]


def number_of(request_file: Path) -> str:
    """Return the number that identifies a pair of files in its folder: `0001`."""
    match = FILE_NAME.fullmatch(request_file.name)
    number = (match["before"] + match["after"]).strip("_-. ") if match else ""
    return number or request_file.stem


def _read(path: Path) -> Mapping[str, Any]:
    try:
        data = YAML(typ="safe", pure=False).load(path)
    except (YAMLError, OSError, ValueError) as error:
        raise CannotConvert(f"{path.name} cannot be read: {' '.join(str(error).split())}") from error
    if not isinstance(data, dict):
        raise CannotConvert(f"{path.name} holds no mapping")
    return data


def _check(data: Mapping[str, Any]) -> None:
    try:
        ProblemSpec.model_validate(data)
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"]))
        raise CannotConvert(f"{place}: {first['msg']}") from error
