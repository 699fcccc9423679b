"""MotionBenchMaker folders as a source of a suite: one set a folder, converted without files in between."""

from collections.abc import Iterator
from pathlib import Path

from optiplan.bench.sources import Found, Place
from optiplan.problem.mbm import Importer, find_pairs, number_of
from optiplan.problem.moveit_objects import CannotConvert
from optiplan.problem.write import write_text


def motion_bench_maker(place: Place) -> Iterator[Found]:
    """Every pair of scene and request below the folder, set by set; a pair that cannot be converted is an issue."""
    root = place.path("mbm").resolve()
    sets: dict[str, list[tuple[Path, Path]]] = {}
    for scene, request in find_pairs(root)[0]:
        sets.setdefault(scene.parent.name, []).append((scene, request))
    if not sets:
        raise place.refuse("mbm", f"no scene*.yaml with request*.yaml below {root}", "a folder of MotionBenchMaker")
    unknown = sorted(set(place.spec.sets or ()) - sets.keys())
    if unknown:
        raise place.refuse("sets", f"unknown set '{unknown[0]}'", f"some of: {', '.join(sorted(sets))}")
    importer = Importer(place.robot())
    for name in place.spec.sets or sorted(sets):
        for scene, request in place.thinned(sets[name]):
            yield _converted(place, importer, scene, request)


def _converted(place: Place, importer: Importer, scene: Path, request: Path) -> Found:
    try:
        data, meshes = importer.convert(scene, request)
    except CannotConvert as error:
        raise place.refuse("mbm", f"{request}: {error}", "problems that can be converted (choose others)") from error
    folder = scene.parent.name
    set_name = f"{place.spec.set}-{folder}" if place.spec.set else folder
    base = place.scratch / set_name
    for file, text in meshes.items():
        write_text(base / file, text)
    origin = {"scene": str(scene), "request": str(request)}
    return Found(number_of(request), set_name, data, base, origin)
