"""PLY files, ASCII or binary of either byte order.

Not by trimesh: it fills the notches of concave polygons, guesses at unknown lines of a header, and accepts an ASCII
file that is cut off within its last number.
"""

import re
from collections.abc import Sequence
from dataclasses import replace
from itertools import chain
from typing import Any

import numpy as np

from optiplan.geometry.meshes.triangles import MOST_TRIANGLES, MeshError, Soup, check_numbers, triangulate
from optiplan.records import dataclass

PLY_TYPES = {
    **dict.fromkeys(("char", "int8"), "i1"),
    **dict.fromkeys(("uchar", "uint8"), "u1"),
    **dict.fromkeys(("short", "int16"), "i2"),
    **dict.fromkeys(("ushort", "uint16"), "u2"),
    **dict.fromkeys(("int", "int32"), "i4"),
    **dict.fromkeys(("uint", "uint32"), "u4"),
    **dict.fromkeys(("float", "float32"), "f4"),
    **dict.fromkeys(("double", "float64"), "f8"),
}
PLY_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}


@dataclass(frozen=True)
class _Property:
    """A property of PLY: its type and, for a list, the type of its length."""

    name: str
    kind: str
    length: str = ""


@dataclass(frozen=True)
class _Element:
    name: str
    count: int
    properties: list[_Property]


def read_ply(content: bytes) -> Soup:
    """Return the polygons of a PLY file, ASCII or binary of either byte order."""
    tables = ply_tables(content)
    vertex, face = tables.get("vertex"), tables.get("face")
    if vertex is None or face is None or not {"x", "y", "z"} <= vertex.keys():
        raise MeshError("a PLY file without vertices x, y, z and faces")
    vertices = np.stack([np.asarray(vertex[axis], np.float64) for axis in "xyz"], axis=1)
    corners = face.get("vertex_indices", face.get("vertex_index"))
    if corners is None or "tristrips" in tables:
        raise MeshError("a PLY file whose faces have no vertex_indices")
    polygons = corners.tolist() if isinstance(corners, np.ndarray) else corners
    indices = np.fromiter(chain.from_iterable(polygons), np.float64)
    if not (np.isfinite(indices) & (indices == np.trunc(indices))).all():
        raise MeshError("a PLY file whose vertex_indices are no whole numbers")
    return Soup(vertices, triangulate(vertices, [[int(index) for index in polygon] for polygon in polygons]))


def ply_tables(content: bytes) -> "dict[str, Table]":
    """Return the elements of a PLY file by name, each as columns by name."""
    end = re.search(rb"(?:^|\n)end_header\r?\n", content[:100_000])
    if not content.startswith(b"ply") or end is None:
        raise MeshError("a PLY file without its header")
    order, elements = _ply_header(content[: end.start()].decode("ascii", "replace").splitlines())
    body = content[end.end() :]
    return _binary_tables(_Bytes(body, order), elements) if order else _ascii_tables(_Words(body), elements)


def _ply_header(lines: Sequence[str]) -> tuple[str, list[_Element]]:
    order: str | None = None
    elements: list[_Element] = []
    for line in lines[1:]:
        match line.split():
            case ["format", name, "1.0"] if name in PLY_ORDERS:
                order = PLY_ORDERS[name]
            case ["element", name, count] if count.isdecimal() and len(count) < 10:
                elements.append(_Element(name, int(count), []))
            case ["property", "list", length, kind, name] if elements and {length, kind} <= PLY_TYPES.keys():
                elements[-1].properties.append(_Property(name, PLY_TYPES[kind], PLY_TYPES[length]))
            case ["property", kind, name] if elements and kind in PLY_TYPES:
                elements[-1].properties.append(_Property(name, PLY_TYPES[kind]))
            case [] | ["comment" | "obj_info", *_]:
                pass
            case _:
                raise MeshError(f"the line '{line[:60]}' in the header of a PLY file")
    if order is None:
        raise MeshError("a PLY file of no known format")
    return order, elements


Table = dict[str, Any]
"""Columns of an element by name: numbers, or lists of numbers."""


class _Words:
    """The numbers of an ASCII body, one after another."""

    def __init__(self, body: bytes) -> None:
        check_numbers(body)
        self._words = iter(body.split())

    def length(self, _: str) -> int:
        return int(next(self._words))

    def values(self, _: str, count: int) -> list[float]:
        return [float(next(self._words)) for _value in range(count)]

    def ended(self) -> bool:
        return next(self._words, None) is None


class _Bytes:
    """The numbers of a binary body of a byte order, from `place` on."""

    def __init__(self, body: bytes, order: str) -> None:
        self.body, self.order, self.place = body, order, 0

    def length(self, kind: str) -> int:
        return int(self.values(kind, 1)[0])

    def values(self, kind: str, count: int) -> list[float]:
        found = np.frombuffer(self.body, self.order + kind, count, self.place)
        self.place += found.nbytes
        return list(found.tolist())


def _ascii_tables(words: _Words, elements: Sequence[_Element]) -> dict[str, Table]:
    try:
        tables = {element.name: _rows(element, words) for element in elements}
    except StopIteration:
        raise MeshError("fewer values than its header says") from None
    if not words.ended():
        raise MeshError("more values than its header says")
    return tables


def _rows(element: _Element, source: _Words | _Bytes) -> Table:
    table: dict[str, list[list[float]]] = {item.name: [] for item in element.properties}
    for _row in range(element.count):
        for item in element.properties:
            count = source.length(item.length) if item.length else 1
            if not 0 <= count <= MOST_TRIANGLES:
                raise MeshError(f"a list of {count} values")
            table[item.name].append(source.values(item.kind, count))
    return {
        item.name: table[item.name] if item.length else [row[0] for row in table[item.name]]
        for item in element.properties
    }


def _binary_tables(source: _Bytes, elements: Sequence[_Element]) -> dict[str, Table]:
    """Read each element as one array, or row by row if its lists have other lengths than those of its first row."""
    tables: dict[str, Table] = {}
    size = len(source.body)
    for element in elements:
        if element.count == 0:  # without a first row
            tables[element.name] = _rows(element, source)
            continue
        record, start = _record_of_first_row(element, source), source.place
        end = start + element.count * record.itemsize
        lengths = [f"#{item.name}" for item in element.properties if item.length]
        if end > size and not lengths:
            raise MeshError(f"{size} bytes of data where its header says {end}")
        values = np.frombuffer(source.body, record, element.count if end <= size else 0, start)
        if end <= size and all((values[name] == values[name][0]).all() for name in lengths):
            tables[element.name], source.place = {item.name: values[item.name] for item in element.properties}, end
        else:
            tables[element.name] = _rows(element, source)
    if source.place != size:
        raise MeshError(f"{size} bytes of data where its header says {source.place}")
    return tables


def _record_of_first_row(element: _Element, source: _Bytes) -> np.dtype[Any]:
    """Return the type of the first row, with the length of list `name` in the field `#name`."""
    lists = any(item.length for item in element.properties)
    start, first = source.place, _rows(replace(element, count=1), source) if lists else {}
    source.place = start
    fields: list[tuple[str, str, tuple[int, ...]]] = []
    for item in element.properties:
        fields += [(f"#{item.name}", source.order + item.length, ())] if item.length else []
        fields.append((item.name, source.order + item.kind, (len(first[item.name][0]),) if item.length else ()))
    return np.dtype(fields)
