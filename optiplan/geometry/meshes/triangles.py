"""Triangle meshes: the content of a mesh file, the error for an unusable one, and triangulation of polygons."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import field
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from optiplan.arrays import Array
from optiplan.records import dataclass

Triangles = npt.NDArray[np.int64]
Number = TypeVar("Number", int, float)

MOST_TRIANGLES = 2_000_000
"""Triangles of one file, each instance counted."""


class MeshError(ValueError):
    """A mesh file that cannot be used; the message names what was found in it."""


@dataclass(frozen=True, eq=False)
class Soup:
    """Content of a mesh file.

    Attributes:
        vertices: (k, 3), m, in the axes of the file.
        triangles: (m, 3) indices of vertices.
        turn: (3, 3) rotation from the axes of the file to axes with z up; the identity if the file names none.
    """

    vertices: Array
    triangles: Triangles
    turn: Array = field(default_factory=lambda: np.eye(3))


def is_ended(text: bytes) -> bool:
    """Return whether the last line ends, so that its last number is complete."""
    return not text or text.rstrip(b" \t\0").endswith((b"\n", b"\r"))


def check_numbers(text: bytes) -> None:
    """Require a text of numbers whose last line ends, without `_`: Python reads 1_000 as a number.

    Raises:
        MeshError: it is truncated, or holds a `_`.
    """
    if not is_ended(text):
        raise MeshError("a last line without a line break: a file that is cut off? If it is whole, end that line")
    if (place := text.find(b"_")) >= 0:
        raise MeshError(f"'{text[max(place - 20, 0) : place + 20].decode('ascii', 'replace')}' where numbers are meant")


def floats(words: Iterable[bytes] | Iterable[str]) -> Array:
    """Return words as finite numbers.

    Raises:
        MeshError: a word that is not a finite number.
    """
    values = np.array([_read(float, word) for word in words], dtype=np.float64)
    if not np.isfinite(values).all():
        raise MeshError("a coordinate that is not a finite number")
    return values


def whole_numbers(words: Iterable[bytes] | Iterable[str]) -> Triangles:
    """Return words as whole numbers below 2^31.

    Raises:
        MeshError: a word that is no such number.
    """
    values = [_read(int, word) for word in words]
    if any(abs(value) >= 2**31 for value in values):
        raise MeshError("a number with more digits than an index has")
    return np.array(values, dtype=np.int64)


def _read(kind: Callable[[str], Number], word: bytes | str) -> Number:
    shown = word if isinstance(word, str) else word.decode("ascii", "replace")
    try:
        return kind(shown.replace("_", "no digit"))  # Python takes 1_000 for a number
    except ValueError as error:
        raise MeshError(f"'{shown[:40]}' where a {'whole ' * (kind is int)}number is meant") from error


def triangulate(vertices: Array, polygons: Sequence[Sequence[int]]) -> Triangles:
    """Return the triangles (m, 3) of polygons given by vertex indices, by ear clipping."""
    total = sum(max(len(polygon) - 2, 0) for polygon in polygons)
    if total > MOST_TRIANGLES:
        raise MeshError(f"{total} triangles; at most {MOST_TRIANGLES} are read")
    if polygons and (max(map(max, polygons), default=0) >= len(vertices) or min(map(min, polygons), default=0) < 0):
        raise MeshError(f"a polygon of a vertex that is not among the {len(vertices)} there are")
    cut: list[Sequence[int]] = []
    for polygon in polygons:
        cut += [polygon] if len(polygon) == 3 else _cut(vertices[list(polygon)], list(polygon))
    return np.array(cut, dtype=np.int64).reshape(-1, 3)


def _cut(corners: Array, names: list[int]) -> list[Sequence[int]]:
    """Return the triangles of one polygon with corners (k, 3), by the indices `names` of its corners."""
    following = np.roll(corners, -1, axis=0)
    normal = 0.5 * np.cross(corners, following).sum(axis=0)  # Newell: its length is the polygon's area
    axis = int(np.abs(normal).argmax())
    flat = np.delete(corners, axis, axis=1)
    sign = (1.0 if axis != 1 else -1.0) * np.sign(normal[axis])
    ring, triangles = list(range(len(names))), []
    if len(ring) > 2000:
        raise MeshError(f"a polygon of {len(ring)} corners")
    while len(ring) > 3:
        ear = next((i for i in range(len(ring)) if _is_ear(flat, ring, i, sign)), 1)
        triangles.append([names[ring[ear - 1]], names[ring[ear]], names[ring[(ear + 1) % len(ring)]]])
        del ring[ear]
    return [*triangles, [names[i] for i in ring]]


def _is_ear(flat: Array, ring: list[int], i: int, sign: float) -> bool:
    """Return whether the triangle about corner i of a plane polygon lies inside the polygon."""
    a, b, c = (flat[ring[k % len(ring)]] for k in (i - 1, i, i + 1))
    if sign * _turn(a, b, c) <= 0.0:
        return False
    others = [flat[k] for k in ring if k not in (ring[i - 1], ring[i], ring[(i + 1) % len(ring)])]
    return not any(
        sign * _turn(a, b, p) >= 0.0 and sign * _turn(b, c, p) >= 0.0 and sign * _turn(c, a, p) >= 0.0 for p in others
    )


def _turn(a: Array, b: Array, c: Array) -> float:
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))


def pack_soup(soup: Soup) -> bytes:
    """Return a soup as bytes: its sizes, then its numbers."""
    sizes = np.array([len(soup.vertices), len(soup.triangles)], "<i8")
    arrays = (sizes, soup.turn.astype("<f8"), soup.vertices.astype("<f8"), soup.triangles.astype("<i4"))
    return b"".join(np.ascontiguousarray(array).tobytes() for array in arrays)


def unpack_soup(data: bytes) -> Soup:
    """Return the soup that `pack_soup` wrote; its arrays are read-only."""
    k, m = (int(size) for size in np.frombuffer(data, "<i8", 2))
    turn: Array = np.frombuffer(data, "<f8", 9, 16).reshape(3, 3)
    vertices: Array = np.frombuffer(data, "<f8", 3 * k, 88).reshape(k, 3)
    triangles: Triangles = np.frombuffer(data, "<i4", 3 * m, 88 + 24 * k).reshape(m, 3).astype(np.int64)
    return Soup(vertices, triangles, turn)
