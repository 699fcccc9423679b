"""Transfer of files with a task: other machines have optiplan, but neither this checkout nor its robots and meshes.

A *bundle* is a mesh, or a robot with all files that it is read from. A packed problem names bundles
by the hash of their content in place of files; workers cache bundles by hash and request missing contents.
"""

import os
import re
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from copy import deepcopy
from dataclasses import replace
from pathlib import Path, PurePosixPath
from typing import Any

from optiplan import cache
from optiplan.bench.execution.robot_cache import RobotCache
from optiplan.bench.results.records import CHANGED, BenchProblem, ChangedError
from optiplan.config.document import Document
from optiplan.errors import OptiPlanError, named_reason
from optiplan.files import read_bytes, reading
from optiplan.problem.from_data import planned_robot
from optiplan.problem.hashing import problem_hash, shape_files_of
from optiplan.records import dataclass
from optiplan.robot.robot import robot_names

SCHEME = "travel://"
"""Of a file in a bundle: `travel://<digest>/<path in it>`."""

LEVELS = 4
"""Folders above a robot's files that stay in its bundle: the names of meshes in a URDF may go through them."""

TEXTS = (".yaml", ".yml", ".urdf", ".srdf", ".xml")
"""Files of a robot in which absolute paths are put right where they arrive."""


class TravelError(OptiPlanError):
    """Files that cannot be transferred."""


@dataclass(frozen=True)
class BundleContents:
    """Content of a bundle: its original folder, and its files by their path below that."""

    home: str
    files: Mapping[str, bytes]

    @property
    def digest(self) -> str:
        """Hash of the files, by which the bundle is known; its home does not count."""
        return cache.digest(part for path, content in self.files.items() for part in (path.encode(), content))


class Packer:
    """Pack the problems of a suite; each robot and mesh is read once and kept by hash, not by content."""

    def __init__(self) -> None:
        self._robots = RobotCache()
        self._digests: dict[str, str] = {}
        self._bundles: dict[str, tuple[Path, tuple[Path, ...]]] = {}

    @reading()  # the hash is of the same bytes as the bundles
    def pack(self, problem: BenchProblem) -> BenchProblem:
        """Return the problem with bundles in place of files; shipped robots stay names.

        Raises:
            TravelError: a robot that cannot be loaded from its files alone.
            ChangedError: files that are not the suite's any more.
        """
        data: dict[str, Any] = deepcopy(dict(problem.data))
        if isinstance(data["robot"], dict):
            raise TravelError(
                f"the robot of {problem.id} stands in the problem itself; give it a robot.yaml of its own"
            )
        base = Path("/")
        robot = planned_robot(Document(Path(problem.id), data, {}), base, self._robots)
        problem.check_unchanged(problem_hash(data, base, robot))
        if data["robot"] not in robot_names():
            data["robot"] = self._robot(data["robot"])
        for mesh in shape_files_of(data):
            path = Path(mesh["file"])
            mesh["file"] = self._bundle(str(path), path.parent, (path,)) + path.name
        return replace(problem, data=data)

    def bundle_contents(self, digest: str) -> BundleContents:
        """Return the files of a bundle."""
        return _read(*self._bundles[digest])

    def _robot(self, ref: str) -> str:
        """Pack a robot and check that it loads from its bundle alone."""
        known = ref in self._digests
        robot = self._robots(ref)
        paths = tuple(dict.fromkeys(Path(os.path.normpath(path)) for path in robot.files))
        common = Path(os.path.commonpath([path.parent for path in paths]))
        below_root = [common, *common.parents][:-1] or [common]
        home = below_root[min(LEVELS, len(below_root) - 1)]
        packed = self._bundle(ref, home, paths) + str(robot.source.relative_to(home))
        if not known:
            keep(self._digests[ref], self.bundle_contents(self._digests[ref]))
            try:
                RobotCache()(str(_unpacked(packed)))
            except OptiPlanError as error:
                raise TravelError(f"robot {ref} cannot be taken to other machines: {error}") from error
        return packed

    def _bundle(self, ref: str, home: Path, paths: tuple[Path, ...]) -> str:
        if ref not in self._digests:
            digest = self._digests[ref] = _read(home, paths).digest
            self._bundles[digest] = (home, paths)
        return f"{SCHEME}{self._digests[ref]}/"


def lacking(problem: BenchProblem) -> set[str]:
    """Return the bundles of a packed problem that are not cached here."""
    return {ref.removeprefix(SCHEME).partition("/")[0] for ref in _refs(problem.data) if not _folder(ref).is_dir()}


def keep(digest: str, bundle_contents: BundleContents) -> None:
    """Store a bundle in the cache atomically.

    Raises:
        ChangedError: its files are not those of the digest: they were changed after the problem was packed.
        TravelError: the cache cannot hold it.
    """
    if bundle_contents.digest != digest:
        raise ChangedError(f"{bundle_contents.home}: {CHANGED}")
    folder = _folder(f"{SCHEME}{digest}/")
    folder.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder.parent) as scratch:
        fresh = Path(scratch, digest)
        for name, content in bundle_contents.files.items():
            path = fresh / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(_settled(content, bundle_contents.home, folder) if path.suffix in TEXTS else content)
        try:
            fresh.rename(folder)
        except OSError as error:
            if not folder.is_dir():  # else another process was faster
                raise TravelError(f"{folder} cannot be written: {named_reason(error)}") from error


def unpack_files(problem: BenchProblem) -> BenchProblem:
    """Return the problem with files in place of bundles, which are all cached.

    It has no hash then: paths in its robot's files are others here, and the bundles are known by theirs.
    """
    if not any(_refs(problem.data)):
        return problem
    data: dict[str, Any] = deepcopy(dict(problem.data))
    data["robot"] = _unpacked(data["robot"])
    for mesh in shape_files_of(data):
        mesh["file"] = _unpacked(mesh["file"])
    return replace(problem, data=data, hash="")


def _read(home: Path, paths: Iterable[Path]) -> BundleContents:
    return BundleContents(str(home), {str(path.relative_to(home)): read_bytes(path) for path in paths})


def _refs(data: Mapping[str, Any]) -> Iterator[str]:
    yield from (
        ref for ref in (data["robot"], *(mesh["file"] for mesh in shape_files_of(data))) if ref.startswith(SCHEME)
    )


def _unpacked(ref: str) -> str:
    if not ref.startswith(SCHEME):
        return ref
    return str(_folder(ref) / PurePosixPath(ref.removeprefix(SCHEME).partition("/")[2]))


def _folder(ref: str) -> Path:
    return cache.cache_dir() / "travel" / ref.removeprefix(SCHEME).partition("/")[0]


def _settled(content: bytes, home: str, folder: Path) -> bytes:
    """Replace absolute paths below the original folder by paths below the new one."""
    pattern = rb"([\"'\s>]|file://)" + re.escape(home.rstrip("/").encode()) + rb"/(?=[^\s>])"  # `/>` is no root folder
    return re.sub(pattern, rb"\g<1>" + str(folder).encode().replace(b"\\", rb"\\") + b"/", content)
