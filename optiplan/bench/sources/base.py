"""Interface of the sources of a suite's problems.

A reader is a function `(Place) -> Iterator[Found]`. It yields problems in a fixed order, the same at every call, and
raises `InputError` for a source that cannot be used; `Place` makes the issues, with the line in the suite file.
"""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from optiplan.bench.suite.schema import SourceSpec, expand_environment
from optiplan.config.document import Document
from optiplan.errors import InputError, Issue
from optiplan.records import dataclass

Item = TypeVar("Item")


@dataclass(frozen=True)
class Found:
    """Problem found by a source.

    Attributes:
        name: unique in its set.
        set_name: the set it belongs to.
        data: content of a problem file.
        base: folder that meshes and robot files in `data` are relative to.
        origin: where it came from, JSON-ready: with this it can be found or made again.
        difficulty: label, where the source knows one.
        document: the file it was read from, for the lines of issues; None when there is none.
    """

    name: str
    set_name: str
    data: Mapping[str, Any]
    base: Path
    origin: Mapping[str, Any]
    difficulty: str | None = None
    document: Document | None = None

    @property
    def id(self) -> str:
        """Unique in the suite."""
        return f"{self.set_name}/{self.name}"


@dataclass(frozen=True)
class Place:
    """A source of a suite with its place in the suite file.

    Attributes:
        spec: the source.
        index: its place in the suite's list.
        document: the suite file.
        scratch: folder for files that problems need and that no source holds, such as meshes out of scenes; it stays.
    """

    spec: SourceSpec
    index: int
    document: Document
    scratch: Path

    @property
    def folder(self) -> Path:
        """Folder that relative paths are resolved against."""
        return self.document.path.resolve().parent

    def issue(self, key: str, found: str, expected: str) -> Issue:
        """An `Issue` about one key of the source."""
        return self.document.issue(("problems", self.index, key), found, expected)

    def refuse(self, key: str, found: str, expected: str) -> InputError:
        """Return an error about one key of the source, to be raised."""
        return InputError([self.issue(key, found, expected)])

    def path(self, key: str) -> Path:
        """Return the path of a key of the source, variables replaced.

        Raises:
            InputError: a variable that is not set.
        """
        return self.folder / self.text(key)

    def text(self, key: str) -> str:
        """Return the text of a key of the source, variables replaced.

        Raises:
            InputError: a variable that is not set.
        """
        text = str(getattr(self.spec, key))
        try:
            return expand_environment(text)
        except KeyError as error:
            expected = f"the environment variable {error.args[0]} to be set"
            raise self.refuse(key, f"'{text}'", expected) from None

    def robot(self) -> str | None:
        """Return the robot of the source: a shipped one's name, or an absolute path."""
        from optiplan.robot.robot import robot_names

        if self.spec.robot is None or self.spec.robot in robot_names():
            return self.spec.robot
        path = self.path("robot").resolve()
        if not path.is_file():
            raise self.refuse("robot", f"no file {path}", "a robot of `optiplan robots`, or the path of a robot.yaml")
        return str(path)

    def chosen(self, sets: Mapping[str, Sequence[Item]]) -> Iterator[tuple[str, str, Item]]:
        """Yield the problems of the sets that `sets` names, thinned: set, its name in the suite, problem.

        Raises:
            InputError: the source has no such set.
        """
        wanted = self.spec.sets or sorted(sets)
        unknown = sorted(set(wanted) - sets.keys())
        if unknown:
            raise self.refuse("sets", f"unknown set '{unknown[0]}'", f"some of: {', '.join(sorted(sets))}")
        for name in wanted:
            shown = f"{self.spec.set}-{name}" if self.spec.set else name
            yield from ((name, shown, item) for item in self.thinned(sets[name]))

    def thinned(self, items: Sequence[Item]) -> Sequence[Item]:
        """Keep every k-th problem of one set, then the first ones, as `every` and `first` say."""
        return items[:: self.spec.every][: self.spec.first]
