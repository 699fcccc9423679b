"""Mesh files that are lists of triangles or polygons: STL and OBJ. Bytes in, arrays out, nothing guessed.

These readers are strict: what they do not understand is an error, since what is passed over would never be checked.
They run in a process of their own (`mesh_reading`) and import nothing but NumPy.
"""

import re

import numpy as np

from optiplan.arrays import Array
from optiplan.geometry.meshes.triangles import MeshError, Soup, floats, plain, triangulate

FREE_FORM = frozenset("bevel call cstype csh curv curv2 deg end hole parm scrv sp step surf trim vp".split())
"""Statements of OBJ files that make surfaces of another kind than polygons."""

SKIPPED = frozenset(
    "c_interp con ctech d_interp g l lod maplib mg mtllib o p s shadow_obj stech trace_obj usemap usemtl vn vt".split()
)
"""Statements of OBJ files that do not change which polygons there are."""


def read_stl(content: bytes) -> Soup:
    """Binary or ASCII STL; corners at the same place are one vertex."""
    count = int.from_bytes(content[80:84], "little")
    if len(content) == 84 + 50 * count and count > 0:
        record = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
        corners = np.frombuffer(content, record, count, 84)["corners"]
    else:
        corners = _ascii_corners(content, count)
    vertices = corners.reshape(-1, 3).astype(np.float64)
    return plain(vertices, np.arange(len(vertices)).reshape(-1, 3))


def _ascii_corners(content: bytes, count: int) -> Array:
    if not content.lstrip().startswith(b"solid"):
        raise MeshError(f"{len(content)} bytes of binary STL that says it has {count} triangles")
    lines = [line.split() for line in content.splitlines()]
    numbers = [line[1:] for line in lines if line and line[0].lower() == b"vertex"]
    facets = sum(line[0].lower() == b"facet" for line in lines if line)
    ends = sum(line[0].lower() == b"endfacet" for line in lines if line)
    if len(numbers) != 3 * facets or facets != ends or any(len(words) != 3 for words in numbers):
        raise MeshError(f"an ASCII STL of {facets} facets, {ends} of them ended, with {len(numbers)} vertices")
    return floats([word for words in numbers for word in words]).astype(np.float32).astype(np.float64)


def read_obj(content: bytes) -> Soup:
    """Polygons of a Wavefront OBJ; materials, normals, lines and points are passed over."""
    points: list[list[bytes]] = []
    polygons: list[list[int]] = []
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
        elif keyword in FREE_FORM:
            raise MeshError(f"line {number}: '{keyword}', a surface that is not made of polygons")
        elif keyword not in SKIPPED:
            raise MeshError(f"line {number}: '{_shown(line)}', which is no statement of an OBJ file")
    vertices = floats([word for point in points for word in point]).reshape(-1, 3)
    return plain(vertices, triangulate(vertices, polygons))


def _obj_index(word: bytes, known: int, line: int) -> int:
    """Index from 0 of a corner such as 3, 3/1, 3//2 or -1 (the last vertex so far)."""
    first = word.split(b"/", 1)[0]
    try:
        index = int(first)
    except ValueError:
        index = 0
    if index == 0 or index < -known:
        raise MeshError(f"line {line}: '{_shown(word)}', which is no vertex")
    return index - 1 if index > 0 else known + index


def _shown(text: bytes) -> str:
    return text[:60].decode("ascii", "replace").strip()
