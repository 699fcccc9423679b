"""Files of OctoMap: the surface around the occupied cells of an octree.

The tree has depth 16 and its centre at the origin; its smallest cells have edges of `res` m. A `.bt` file marks every
cell as free, occupied, divided or unknown. An `.ot` file gives its log-odds: a leaf with log-odds >= 0, a probability
of at least 0.5, is occupied. Unknown cells are no obstacle.
Source: Hornung et al., OctoMap, Autonomous Robots 34 (2013), and the readers of the library itself.
"""

import re
import struct
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from optiplan.geometry.meshes.box_surfaces import surface_of_cells
from optiplan.geometry.meshes.triangles import MOST_TRIANGLES, MeshError, Soup

DEPTH = 16
"""Levels of a tree below its root."""

_COLOUR = {"OcTree": 0, "ColorOcTree": 3}
"""Bytes behind the log-odds of a cell of an `.ot` file, by the kind of its tree."""

_FREE, _OCCUPIED, _DIVIDED = 1, 2, 3

_MOST_CELLS = MOST_TRIANGLES // 12
_HEADER = re.compile(rb"(?:^|\n)data[ \t]*\r?\n")


def read_bt(content: bytes) -> Soup:
    """Return the surface of the occupied cells of a binary OctoMap file."""
    words, body = _header(content, b"# Octomap OcTree binary file")
    return _surface(words, body, lambda: _binary_tree(body))


def read_ot(content: bytes) -> Soup:
    """Return the surface of the occupied cells of an OctoMap file with log-odds."""
    words, body = _header(content, b"# Octomap OcTree file")
    if words["id"] not in _COLOUR:
        raise MeshError(f"a tree of the kind {words['id'][:40]}; {' and '.join(_COLOUR)} are read")
    return _surface(words, body, lambda: _full_tree(body, _COLOUR[words["id"]]))


def _header(content: bytes, first: bytes) -> tuple[dict[str, str], bytes]:
    end = _HEADER.search(content[:100_000])
    if not content.startswith(first) or end is None:
        raise MeshError(f"a file that does not begin with the header of its kind ('{first.decode()}', … data)")
    lines = [line.split(None, 1) for line in content[: end.start()].decode("ascii", "replace").splitlines()]
    words = {line[0]: line[1].strip() for line in lines if len(line) == 2 and line[0] != "#"}
    missing = [key for key in ("id", "size", "res") if key not in words]
    if missing:
        raise MeshError(f"a header without {', '.join(missing)}")
    return words, content[end.end() :]


Cells = list[tuple[int, int, int, int]]
"""Cells as x, y, z of their lowest corner and their edge, all in smallest cells."""


class ReadOctree(NamedTuple):
    """The occupied cells of a tree, its number of nodes, and its size in bytes."""

    occupied: Cells
    nodes: int
    size: int


def _surface(words: dict[str, str], body: bytes, tree: Callable[[], ReadOctree]) -> Soup:
    """Return the surface of the occupied cells; resolution and size come from the header."""
    try:
        resolution = float(words["res"])
    except ValueError:
        resolution = 0.0
    if not 0.0 < resolution <= 1e3:
        raise MeshError(f"a resolution of '{words['res'][:40]}' m")
    try:
        read = tree() if words["size"] != "0" else ReadOctree([], 0, 0)
    except (IndexError, struct.error):
        raise MeshError("a tree that ends in the middle") from None
    if str(read.nodes) != words["size"]:
        raise MeshError(f"a tree of {read.nodes} nodes where its header says {words['size'][:40]}")
    if read.size != len(body):
        raise MeshError(f"{len(body)} bytes of data where its tree takes {read.size}")
    found = np.array(read.occupied, dtype=np.int64).reshape(-1, 4)
    if len(found) == 0:
        raise MeshError("no occupied cell")
    corners, triangles = surface_of_cells(found[:, :3], found[:, 3])
    return Soup(np.asarray(corners * resolution, dtype=np.float64), triangles)


def _root() -> tuple[int, int, int, int]:
    half = 1 << (DEPTH - 1)
    return -half, -half, -half, 2 * half


def _child(cell: tuple[int, int, int, int], which: int) -> tuple[int, int, int, int]:
    """Return one of the eight parts of a cell; bits 0, 1, 2 of `which` select the upper half in x, y, z."""
    x, y, z, edge = cell
    half = edge // 2
    if half == 0:
        raise MeshError(f"a tree of more than {DEPTH} levels")
    return x + half * (which & 1), y + half * (which >> 1 & 1), z + half * (which >> 2 & 1), half


def _binary_tree(body: bytes) -> ReadOctree:
    """Read two bits for each child, child 0 in the lowest; the divided children follow in their order."""
    occupied: Cells = []
    waiting, at, nodes = [_root()], 0, 1
    while waiting:
        cell = waiting.pop()
        kinds = body[at] | body[at + 1] << 8
        at += 2
        divided = []
        for which in range(8):
            kind = kinds >> 2 * which & 3
            nodes += kind != 0
            if kind == _OCCUPIED:
                occupied.append(_child(cell, which))
            elif kind == _DIVIDED:
                divided.append(_child(cell, which))
        waiting += divided[::-1]
        _check_number(occupied)
    return ReadOctree(occupied, nodes, at)


def _full_tree(body: bytes, colour: int) -> ReadOctree:
    """Read log-odds (and colour) of a cell and a byte with a bit for each child; the children follow in their order."""
    occupied: Cells = []
    waiting, at, nodes = [_root()], 0, 0
    while waiting:
        cell = waiting.pop()
        nodes += 1
        (log_odds,) = struct.unpack_from("<f", body, at)
        children = body[at + 4 + colour]
        at += 5 + colour
        if children:
            waiting += [_child(cell, which) for which in range(7, -1, -1) if children >> which & 1]
        elif log_odds >= 0.0:
            occupied.append(cell)
        _check_number(occupied)
    return ReadOctree(occupied, nodes, at)


def _check_number(cells: Cells) -> None:
    if len(cells) > _MOST_CELLS:
        raise MeshError(f"more than {_MOST_CELLS} occupied cells")
