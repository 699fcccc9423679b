"""Kinds of sources of a suite by name, each imported when a suite asks for it."""

from collections.abc import Callable, Iterator
from pathlib import Path

from optiplan.bench.sources.base import Found, Place
from optiplan.config.document import read_yaml
from optiplan.errors import InputError, Issue


def read_source(place: Place) -> Iterator[Found]:
    """The problems of a source.

    Raises:
        InputError: the source cannot be used.
    """
    kind = place.spec.kind
    if kind not in READERS:
        raise place.refuse(kind, f"the source '{kind}'", f"one that this release reads: {', '.join(READERS)}")
    return READERS[kind](place)


def problem_files(place: Place) -> Iterator[Found]:
    """Problem files that match the pattern, by name; the set is their folder unless one is given.

    Raises:
        InputError: no file matches; or, after all others, what is wrong with those that cannot be read.
    """
    pattern = Path(place.text("glob"))
    start = Path(pattern.anchor) if pattern.anchor else place.folder  # whose own name may hold a * or a [
    try:
        files = sorted(path for path in start.glob(str(pattern.relative_to(pattern.anchor))) if path.is_file())
    except ValueError as error:
        raise place.refuse("glob", f"'{pattern}': {error}", "a pattern of problem files") from error
    if not files:
        raise place.refuse("glob", f"no file matches {place.folder / pattern}", "a pattern of problem files")
    issues: list[Issue] = []
    for path in place.thinned(files):
        try:
            document = read_yaml(path)
        except InputError as error:
            issues += error.issues
            continue
        path = path.resolve()
        data = document.data if isinstance(document.data, dict) else {}
        set_name = place.spec.set or path.parent.name
        yield Found(path.stem, set_name, data, path.parent, {"file": str(path)}, None, document)
    if issues:
        raise InputError(issues)


def _mbm(place: Place) -> Iterator[Found]:
    from optiplan.bench.sources.motion_bench_maker import motion_bench_maker

    return motion_bench_maker(place)


def _robometrics(place: Place) -> Iterator[Found]:
    from optiplan.bench.sources.robometrics import robometrics_file

    return robometrics_file(place)


def _generate(place: Place) -> Iterator[Found]:
    from optiplan.bench.sources.generate import generated

    return generated(place)


READERS: dict[str, Callable[[Place], Iterator[Found]]] = {
    "glob": problem_files,
    "mbm": _mbm,
    "robometrics": _robometrics,
    "generate": _generate,
}
"""The key of a source in a suite (`bench.suite.schema.KINDS` says what may stand beside it) to its reader."""
