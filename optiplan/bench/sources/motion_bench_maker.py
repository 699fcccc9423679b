"""MotionBenchMaker folders as a source of a suite: one set a folder, converted without files in between."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import optiplan
from optiplan import cache
from optiplan.bench.sources.base import Found, Place
from optiplan.files import write_text
from optiplan.importers.motion_bench_maker import Importer, find_pairs, number_of
from optiplan.importers.moveit_objects import CannotConvert
from optiplan.robot.robot import load_robot

CONVERSION = 2
"""Counted up when files are converted in another way, so that cached ones are converted again."""


def motion_bench_maker(place: Place) -> Iterator[Found]:
    """Every pair of scene and request below the folder, set by set; a pair that cannot be converted is an issue."""
    root = place.path("mbm").resolve()
    sets: dict[str, list[tuple[Path, Path]]] = {}
    for scene, request in find_pairs(root)[0]:
        sets.setdefault(scene.parent.name, []).append((scene, request))
    if not sets:
        raise place.refuse("mbm", f"no scene*.yaml with request*.yaml below {root}", "a folder of MotionBenchMaker")
    converter = _Converter(place.robot())
    for _, set_name, (scene, request) in place.chosen(sets):
        yield _found(place, converter, set_name, scene, request)


def _found(place: Place, converter: "_Converter", set_name: str, scene: Path, request: Path) -> Found:
    try:
        data, meshes = converter.convert(scene, request)
    except CannotConvert as error:
        raise place.refuse("mbm", f"{request}: {error}", "problems that can be converted (choose others)") from error
    base = place.scratch / set_name
    for file, text in meshes.items():
        write_text(base / file, text)
    origin = {"scene": str(scene), "request": str(request)}
    return Found(number_of(request), set_name, data, base, origin)


class _Converter:
    """Convert with the source's robot and cache the results: reading these files is slow."""

    def __init__(self, robot: str | None) -> None:
        self._importer = Importer(robot)
        self._key = (
            None if robot is None else [f"{optiplan.__version__} {CONVERSION} {robot}", load_robot(robot).fingerprint]
        )

    def convert(self, scene: Path, request: Path) -> tuple[dict[str, Any], dict[str, str]]:
        """Convert one problem, as `Importer.convert`."""
        if self._key is None:  # the robot depends on the scene
            return self._importer.convert(scene, request)
        names = (scene.resolve().parent.name, number_of(request))
        texts = (part.encode() for part in (*self._key, *names))
        file = f"mbm/{cache.digest([*texts, scene.read_bytes(), request.read_bytes()])}.json"
        kept = cache.load(file)
        if kept is None:
            kept = json.dumps(self._importer.convert(scene, request)).encode()
            cache.store(file, kept)
        data, meshes = json.loads(kept)
        return data, meshes
