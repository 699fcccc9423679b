"""PLY files, ASCII or binary of either byte order."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from optiplan.geometry.meshes.triangles import (
    MOST_TRIANGLES,
    MeshError,
    Soup,
    check_numbers,
    triangulate,
)

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
    return Soup(vertices, triangulate(vertices, [[int(index) for index in polygon] for polygon in corners]))


def ply_tables(content: bytes) -> "dict[str, Table]":
    """Return the elements of a PLY file by name, each as columns by name."""
    end = re.search(rb"(?:^|\n)end_header\r?\n", content[:100_000])
    if not content.startswith(b"ply") or end is None:
        raise MeshError("a PLY file without its header")
    order, elements = _ply_header(content[: end.start()].decode("ascii", "replace").splitlines())
    rows = _ply_ascii if order == "" else _ply_binary
    return rows(content[end.end() :], elements, order)


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


def _ply_ascii(body: bytes, elements: Sequence[_Element], _: str) -> dict[str, Table]:
    check_numbers(body)
    try:
        return _ply_tables(iter(body.split()), elements)
    except StopIteration:
        raise MeshError("fewer values than its header says") from None


def _ply_tables(words: Iterator[bytes], elements: Sequence[_Element]) -> dict[str, Table]:
    tables: dict[str, Table] = {}
    for element in elements:
        table: dict[str, list[list[float]]] = {item.name: [] for item in element.properties}
        for _row in range(element.count):
            for item in element.properties:
                count = int(next(words)) if item.length else 1
                if not 0 <= count <= MOST_TRIANGLES:
                    raise MeshError(f"a list of {count} values")
                table[item.name].append([float(next(words)) for _value in range(count)])
        tables[element.name] = {item.name: _column(table[item.name], item) for item in element.properties}
    if next(words, None) is not None:
        raise MeshError("more values than its header says")
    return tables


def _column(rows: list[list[float]], item: _Property) -> list[list[float]] | list[float]:
    return rows if item.length else [row[0] for row in rows]


def _ply_binary(body: bytes, elements: Sequence[_Element], order: str) -> dict[str, Table]:
    tables: dict[str, Table] = {}
    place = 0
    for element in elements:
        lists = any(item.length for item in element.properties)
        tables[element.name], place = (_ply_lists if lists else _ply_table)(body, place, element, order)
    if place != len(body):
        raise MeshError(f"{len(body)} bytes of data where its header says {place}")
    return tables


def _ply_table(body: bytes, place: int, element: _Element, order: str) -> tuple[Table, int]:
    record = np.dtype([(item.name, order + item.kind) for item in element.properties])
    end = place + element.count * record.itemsize
    if end > len(body):
        raise MeshError(f"{len(body)} bytes of data where its header says {end}")
    values = np.frombuffer(body, record, element.count, place)
    return {item.name: values[item.name] for item in element.properties}, end


def _ply_lists(body: bytes, place: int, element: _Element, order: str) -> tuple[Table, int]:
    """Read an element with lists, as one table if all lists have the length of those in the first row."""
    first, row = _ply_row(body, place, element, order)
    fields = [(f"#{item.name}", order + item.length) for item in element.properties if item.length]
    record = np.dtype([field for item in element.properties for field in _ply_fields(item, first, order)])
    if element.count * record.itemsize <= len(body) - place:
        values = np.frombuffer(body, record, element.count, place)
        if all((values[name] == values[name][0]).all() for name, _ in fields):
            return {item.name: values[item.name] for item in element.properties}, place + element.count * row
    table: dict[str, list[list[float]]] = {item.name: [] for item in element.properties}
    for _row in range(element.count):
        found, size = _ply_row(body, place, element, order)
        place += size
        for item in element.properties:
            table[item.name].append(found[item.name])
    return {item.name: _column(table[item.name], item) for item in element.properties}, place


def _ply_fields(item: _Property, first: dict[str, list[float]], order: str) -> list[tuple[str, str, tuple[int, ...]]]:
    if not item.length:
        return [(item.name, order + item.kind, ())]
    return [(f"#{item.name}", order + item.length, ()), (item.name, order + item.kind, (len(first[item.name]),))]


def _ply_row(body: bytes, place: int, element: _Element, order: str) -> tuple[dict[str, list[float]], int]:
    """Return the values of one row, and its size in bytes."""
    found: dict[str, list[float]] = {}
    start = place
    for item in element.properties:
        count = 1
        if item.length:
            count = int(np.frombuffer(body, order + item.length, 1, place)[0])
            place += np.dtype(item.length).itemsize
        if not 0 <= count <= MOST_TRIANGLES:
            raise MeshError(f"a list of {count} values")
        found[item.name] = np.frombuffer(body, order + item.kind, count, place).tolist()
        place += count * np.dtype(item.kind).itemsize
    return found, place - start
