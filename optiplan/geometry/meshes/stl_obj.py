"""Mesh files that are lists of triangles or polygons: STL and OBJ.

These readers are strict: an unknown statement is an error, because collision checks would miss an ignored part.

Not by trimesh: it accepts an ASCII STL that lacks lines or has foreign bytes in its numbers; of an OBJ it drops
malformed faces and free-form surfaces without a message, fills notches of polygons, and accepts a file that is cut off.
"""

import re
from collections.abc import Sequence

import numpy as np

from optiplan.arrays import Array
from optiplan.geometry.meshes.triangles import MeshError, Soup, floats, is_ended, triangulate

FREE_FORM = frozenset("bevel call cstype csh curv curv2 deg end hole parm scrv sp step surf trim vp".split())
"""Statements of OBJ files for surfaces that are not polygons."""

SKIPPED = frozenset(
    "c_interp con ctech d_interp g lod maplib mg mtllib o s shadow_obj stech trace_obj usemap usemtl vn vt".split()
)
"""Statements of OBJ files without effect on the polygons."""


def read_stl(content: bytes) -> Soup:
    """Return the triangles of a binary or ASCII STL."""
    count = int.from_bytes(content[80:84], "little")
    if len(content) == 84 + 50 * count and count > 0:
        record = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
        corners = np.frombuffer(content, record, count, 84)["corners"]
    else:
        corners = _ascii_corners(content, count)
    vertices = corners.reshape(-1, 3).astype(np.float64)
    return Soup(vertices, np.arange(len(vertices)).reshape(-1, 3))


def _ascii_corners(content: bytes, count: int) -> Array:
    if not content.lstrip().startswith(b"solid"):
        raise MeshError(f"{len(content)} bytes of binary STL that says it has {count} triangles")
    numbers: list[bytes] = []
    facets = 0
    expected: tuple[bytes, ...] = (b"solid",)
    for number, line in enumerate(content.splitlines(), 1):
        words = line.split()
        if not words:
            continue
        keyword = words[0].lower()
        if keyword not in expected or (keyword == b"vertex" and len(words) != 4):
            raise MeshError(f"line {number}: '{_shown(line)}' where {_named(expected)} is meant")
        if keyword == b"vertex":
            numbers += words[1:]
            facets += len(numbers) == 9 * facets + 3
            expected = (b"vertex",) if len(numbers) < 9 * facets else (b"endloop",)
        else:
            expected = _AFTER[keyword]
    if expected != _AFTER[b"endsolid"]:
        raise MeshError(
            f"an ASCII STL that ends after {facets} facets where {_named(expected)} is meant: it is cut off"
        )
    return floats(numbers).astype(np.float32).astype(np.float64)


_AFTER = {
    b"solid": (b"facet", b"endsolid"),
    b"facet": (b"outer",),
    b"outer": (b"vertex",),
    b"endloop": (b"endfacet",),
    b"endfacet": (b"facet", b"endsolid"),
    b"endsolid": (b"solid",),
}
"""First words of the next line of an ASCII STL, by the first word of a line; three `vertex` lines follow `outer`."""


def _named(keywords: Sequence[bytes]) -> str:
    return " or ".join(f"'{keyword.decode()}'" for keyword in keywords)


def read_obj(content: bytes) -> Soup:
    """Return the polygons of a Wavefront OBJ; materials, normals, lines and points are ignored.

    The format has no count and no end mark. A file with an open surface counts as truncated if its last line does not
    end, or if it has unused vertices. A closed surface is complete.
    """
    points: list[list[bytes]] = []
    polygons: list[list[int]] = []
    others: set[int] = set()
    text = re.sub(rb"\\\r?\n", b" ", content)
    for number, line in enumerate(text.splitlines(), 1):
        words = line.split(b"#", 1)[0].split()
        if not words:
            continue
        keyword = words[0].decode("ascii", "replace")
        if keyword == "v" and len(words) in (4, 5, 7, 8):  # with a weight or a colour
            points.append(words[1:4])
        elif keyword in ("f", "fo") and len(words) > 3:
            polygons.append([_obj_index(word, len(points), number) for word in words[1:]])
        elif keyword in ("l", "p"):
            others.update(_obj_index(word, len(points), number) for word in words[1:])
        elif keyword in FREE_FORM:
            raise MeshError(f"line {number}: '{keyword}', a surface that is not made of polygons")
        elif keyword not in SKIPPED:
            raise MeshError(f"line {number}: '{_shown(line)}', which is no statement of an OBJ file")
    vertices = floats([word for point in points for word in point]).reshape(-1, 3)
    soup = Soup(vertices, triangulate(vertices, polygons))
    unused = len(vertices) - len(others.union(*polygons))
    if (unused > 0 or not is_ended(content)) and _is_open(soup):
        signs = f"{unused} vertices that no polygon uses" if unused > 0 else "a last line without a line break"
        remedy = "remove these vertices" if unused > 0 else "end that line"
        raise MeshError(f"{signs} and a surface with open edges: a file that is cut off? If it is whole, {remedy}")
    return soup


def _is_open(soup: Soup) -> bool:
    """Return whether an edge belongs to one triangle only; vertices at the same place are one."""
    _, place = np.unique(soup.vertices, axis=0, return_inverse=True)
    corners = place.reshape(-1)[soup.triangles]
    edges = np.sort(np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]]), axis=1)
    _, counts = np.unique(edges[edges[:, 0] != edges[:, 1]], axis=0, return_counts=True)
    return bool((counts == 1).any())


def _obj_index(word: bytes, known: int, line: int) -> int:
    """Index from 0 of a corner such as 3, 3/1, 3//2 or -1 (the last vertex so far)."""
    first = word.split(b"/", 1)[0]
    try:
        index = int(first.replace(b"_", b"no digit"))  # Python takes 1_000 for a number
    except ValueError:
        index = 0
    if index == 0 or index < -known:
        raise MeshError(f"line {line}: '{_shown(word)}', which is no vertex")
    return index - 1 if index > 0 else known + index


def _shown(text: bytes) -> str:
    return text[:60].decode("ascii", "replace").strip()
