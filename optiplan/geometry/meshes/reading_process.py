"""The process that reads meshes, point clouds and octrees: contents in, arrays out, with limits of memory and time.

Standard input holds jobs: a line `SUFFIX SIZE`, then the content. Standard output holds as many answers in the same
order: a line `mesh SIZE` and a packed `Soup`, or a line `error SIZE` and the reason. If the process ends early, the
first job without an answer is the cause. A job names no file, and this process opens none.

SUFFIX is that of the file, with the prefix `points` for point clouds: a PLY file may hold either.
"""

import math
import resource
import sys
from collections.abc import Callable, Mapping

import numpy as np

from optiplan.geometry.meshes.collada import read_dae
from optiplan.geometry.meshes.gltf import read_glb
from optiplan.geometry.meshes.octomap import read_bt, read_ot
from optiplan.geometry.meshes.ply import read_ply
from optiplan.geometry.meshes.point_clouds import read_pcd, read_points_npz, read_points_ply
from optiplan.geometry.meshes.stl_obj import read_obj, read_stl
from optiplan.geometry.meshes.triangles import MeshError, Soup, pack_soup


def _reader(form: str, read: Callable[[bytes], Soup]) -> Callable[[bytes], Soup]:
    """Return a reader that turns every exception of a broken file into a `MeshError`."""

    def reading(content: bytes) -> Soup:
        try:
            return read(content)
        except (MeshError, MemoryError):
            raise
        except Exception as error:
            reason = " ".join(str(error).split())[:100] or type(error).__name__
            missing = " is missing" * isinstance(error, KeyError)
            raise MeshError(f"not in the form that {form} has ({reason}{missing})") from error

    return reading


READERS: Mapping[str, Callable[[bytes], Soup]] = {
    suffix: _reader(suffix.rpartition(".")[2].upper(), read)
    for suffix, read in {
        ".stl": read_stl,
        ".obj": read_obj,
        ".dae": read_dae,
        ".ply": read_ply,
        ".glb": read_glb,
        "points.ply": read_points_ply,
        "points.pcd": read_pcd,
        "points.npz": read_points_npz,
        ".bt": read_bt,
        ".ot": read_ot,
    }.items()
}
"""Readers by suffix, with the prefix `points` for point clouds.

Each raises:
    MeshError: the content does not have the format of the suffix.
    MemoryError: not enough memory.
"""


def main(seconds: int, memory: int) -> None:
    """Answer all jobs of standard input.

    Args:
        seconds: processor time that one job may take; the limit is of whole seconds, so that it may be one more.
        memory: address space of the process, bytes.
    """
    resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    while line := sys.stdin.buffer.readline():
        suffix, size = line.split()
        used = sum(resource.getrusage(resource.RUSAGE_SELF)[:2])
        resource.setrlimit(resource.RLIMIT_CPU, (math.ceil(used) + seconds, resource.RLIM_INFINITY))
        kind, answer = _answer(suffix.decode(), sys.stdin.buffer.read(int(size)))
        sys.stdout.buffer.write(f"{kind} {len(answer)}\n".encode() + answer)
        sys.stdout.buffer.flush()


def _answer(suffix: str, content: bytes) -> tuple[str, bytes]:
    if not content:
        return "error", b"an empty file"
    try:
        soup = READERS[suffix](content)
        return "mesh", pack_soup(soup if suffix.startswith("points") else _settled(soup))
    except MeshError as error:
        return "error", str(error).encode()
    except MemoryError:
        return "error", b"needs too much memory"


def _settled(soup: Soup) -> Soup:
    """Merge vertices at the same place, in the order of the file, and drop triangles that are a point or a line.

    Raises:
        MeshError: no triangles, or coordinates that are not finite.
    """
    vertices, triangles = np.asarray(soup.vertices, np.float64) + 0.0, soup.triangles  # + 0.0: -0.0 and 0.0 are one
    if vertices.ndim != 2 or vertices.shape[1] != 3 or not np.isfinite(vertices).all():
        raise MeshError("a coordinate that is not a finite number")
    order = np.lexsort(vertices.T)
    sorted_ = vertices[order]
    new = np.ones(len(order), bool)
    new[1:] = (sorted_[1:] != sorted_[:-1]).any(axis=1)
    group = np.cumsum(new) - 1
    same = np.empty(len(order), np.int64)
    same[order] = np.minimum.reduceat(order, np.flatnonzero(new))[group] if len(order) else order
    corners = same[triangles]
    a, b, c = corners.T
    corners = corners[(a != b) & (b != c) & (c != a)]
    if len(corners) == 0:
        raise MeshError("no triangles")
    used = np.unique(corners)
    return Soup(vertices[used], np.searchsorted(used, corners), soup.turn)
