"""Files of meshes, point clouds and octrees as arrays, identified by content: read once in a process, then cached.

A mesh is looked up by the SHA-256 of its content: in memory, then in the cache on disk. Only unknown content goes to
`reading_process`. So a changed file is another mesh, whatever its name.
"""

import os
import signal
import subprocess
import sys
from collections import OrderedDict
from collections.abc import Iterator, Sequence
from pathlib import Path
from threading import Lock
from typing import Literal, NamedTuple

import optiplan
from optiplan import cache, files
from optiplan.errors import os_reason
from optiplan.geometry.meshes.triangles import MeshError, Soup, pack_soup, unpack_soup
from optiplan.records import dataclass

FORMATS = "STL, OBJ, DAE, PLY or GLB"
POINT_FORMATS = "PLY, PCD or NPZ"
OCTREE_FORMATS = "BT or OT, of OctoMap"

Kind = Literal["mesh", "point cloud", "octree"]


class _Formats(NamedTuple):
    """Formats of a kind of file: in words, their suffixes, and what precedes a suffix among `READERS`."""

    words: str
    suffixes: tuple[str, ...]
    prefix: str = ""


KINDS: dict[Kind, _Formats] = {
    "mesh": _Formats(FORMATS, (".stl", ".obj", ".dae", ".ply", ".glb")),
    "point cloud": _Formats(POINT_FORMATS, (".ply", ".pcd", ".npz"), "points"),
    "octree": _Formats(OCTREE_FORMATS, (".bt", ".ot")),
}

VERSION = 3
"""Increase it when a reader returns other arrays for the same file, or refuses it."""

SECONDS, MEMORY = 5, 3 * 2**30
"""Limits of reading one mesh: s of processor time, and bytes of address space of the process."""

WAIT = 60.0
"""s; a reading process that does not use its processor time is ended after this time."""

MOST_KEPT = 512 * 2**20
"""Bytes of arrays kept in memory."""

_CPU = signal.SIGXCPU


@dataclass(frozen=True)
class MeshFile:
    """A file and its content; `key` is the digest of the content and of its reader."""

    path: Path
    key: str
    content: bytes
    kind: Kind = "mesh"

    @property
    def reader(self) -> str:
        """Its key in `reading_process.READERS`."""
        return KINDS[self.kind].prefix + self.path.suffix.lower()


def open_mesh(path: Path, kind: Kind = "mesh") -> MeshFile:
    """Return a file with its content, which is not parsed.

    Raises:
        MeshError: the file cannot be opened, or has an unknown format.
    """
    try:
        content = files.read_bytes(path)
    except OSError as error:
        raise MeshError(f"cannot read {kind} {path}: {os_reason(error)}") from error
    suffix, formats = path.suffix.lower(), KINDS[kind]
    if suffix not in formats.suffixes:
        raise MeshError(f"cannot read {kind} {path}: '{suffix}' is none of {formats.words}")
    reader = formats.prefix + suffix
    return MeshFile(path, cache.digest([str(VERSION).encode(), reader.encode(), content]), content, kind)


class _Ended(str):
    """The reason why a process ended that was short of time or memory, perhaps not for the file: it is not kept."""

    __slots__ = ()


def read_mesh(file: MeshFile) -> Soup:
    """Return the triangles of one mesh file.

    Raises:
        MeshError: the file cannot be used; the message names it and the fault.
    """
    return read_meshes([file])[0]


def read_meshes(meshes: Sequence[MeshFile]) -> list[Soup]:
    """Return the triangles of several mesh files; unknown ones share one process.

    Raises:
        MeshError: the first that cannot be used; the message names it and the fault.
    """
    with _lock:
        found = {mesh.key: _find(mesh.key) for mesh in meshes}
        unknown = list({mesh.key: mesh for mesh in meshes if found[mesh.key] is None}.values())
        read = {mesh.key: answer for mesh, answer in zip(unknown, _read_apart(unknown), strict=True)}
        for key, answer in read.items():
            if isinstance(answer, Soup):
                cache.store(_name(key), pack_soup(answer))
            if not isinstance(answer, _Ended):
                _keep(key, answer)
    return [_soup(mesh, found[mesh.key] or read[mesh.key]) for mesh in meshes]


def _soup(file: MeshFile, found: Soup | str) -> Soup:
    if isinstance(found, str):
        raise MeshError(f"cannot read {file.kind} {file.path}: {found}")
    return found


def known(key: str) -> Soup | None:
    """Return the mesh of a key from memory or disk; None if there is none."""
    with _lock:
        found = _find(key)
    return found if isinstance(found, Soup) else None


_lock = Lock()
_kept: "OrderedDict[str, Soup | str]" = OrderedDict()
"""Meshes, or the reason why there is none, by key; the least recently used is dropped first."""


def _name(key: str) -> str:
    return f"meshes/{key}"


def _find(key: str) -> Soup | str | None:
    """Return the mesh of a key, or the reason why there is none, from memory or disk; None for an unknown key."""
    if key in _kept:
        _kept.move_to_end(key)
        return _kept[key]
    stored = cache.load(_name(key))
    return None if stored is None else _keep(key, unpack_soup(stored))


def _keep(key: str, found: Soup | str) -> Soup | str:
    _kept[key] = found
    while len(_kept) > 1 and sum(map(_size, _kept.values())) > MOST_KEPT:
        _kept.popitem(last=False)
    return found


def _size(kept: Soup | str) -> int:
    return len(kept) if isinstance(kept, str) else kept.vertices.nbytes + kept.triangles.nbytes


def _read_apart(meshes: Sequence[MeshFile]) -> Iterator[Soup | str]:
    """Read each mesh in a process of its own, so that a crash or a timeout fails that mesh alone."""
    rest = list(meshes)
    while rest:
        answers, why = _run_worker(rest)
        yield from answers
        rest = rest[len(answers) :]
        if rest and why:
            yield why
            rest = rest[1:]


def _run_worker(meshes: Sequence[MeshFile]) -> tuple[list[Soup | str], str]:
    """Return the answers received, and the reason why some are missing; empty if none is."""
    jobs = b"".join(f"{mesh.reader} {len(mesh.content)}\n".encode() + mesh.content for mesh in meshes)
    # An editable install is found by a hook that a process without `site` does not have, so the package is named too.
    package = str(Path(optiplan.__file__).parents[1])
    places = [package, *(os.getcwd() if place == "" else place for place in sys.path)]
    boot = "from optiplan.geometry.meshes.reading_process import main"
    code = f"import sys; sys.path[:] = {places!r}; {boot}; main{SECONDS, MEMORY}"
    command = [sys.executable, "-I", "-S", "-c", code]
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
    try:
        done = subprocess.run(
            command,
            input=jobs,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            timeout=WAIT + SECONDS * len(meshes),
            env=environment,
            check=False,
        )
        output, late = done.stdout, False
    except subprocess.TimeoutExpired as error:
        output, late = error.stdout or b"", True
    except OSError as error:
        return [], _Ended(f"no process to read it can be started ({os_reason(error)})")
    answers = list(_answers(output))
    if len(answers) == len(meshes):
        return answers, ""
    if late:
        return answers, _Ended(f"takes more than {WAIT:g} s")
    if done.returncode == -_CPU:
        return answers, f"takes more than {SECONDS} s"
    return answers, _Ended("ends the process that reads it")


def _answers(output: bytes) -> Iterator[Soup | str]:
    place = 0
    while (end := output.find(b"\n", place)) >= 0:
        kind, size = output[place:end].split()
        place = end + 1 + int(size)
        if place > len(output):
            return
        answer = output[end + 1 : place]
        yield unpack_soup(answer) if kind == b"mesh" else answer.decode()
