"""Point clouds: PLY, PCD (ASCII, binary, compressed) and NPZ files as points."""

import io
import re
import zipfile

import numpy as np

from optiplan.arrays import Array
from optiplan.geometry.meshes.ply import ply_tables
from optiplan.geometry.meshes.triangles import MeshError, Soup, check_numbers

MOST_POINTS = 5_000_000
"""Points of one file."""

_NPY_HEADER = 4096
"""Bytes, more than the header of an array of numbers takes."""

_PCD_TYPES = {
    ("F", 4): "<f4",
    ("F", 8): "<f8",
    ("I", 1): "i1",
    ("I", 2): "<i2",
    ("I", 4): "<i4",
    ("I", 8): "<i8",
    ("U", 1): "u1",
    ("U", 2): "<u2",
    ("U", 4): "<u4",
    ("U", 8): "<u8",
}


def read_points_ply(content: bytes) -> Soup:
    """Return the vertices of a PLY file; faces are ignored."""
    vertex = ply_tables(content).get("vertex")
    if vertex is None or not {"x", "y", "z"} <= vertex.keys():
        raise MeshError("a PLY file without vertices x, y, z")
    return _cloud(np.stack([np.asarray(vertex[axis], np.float64) for axis in "xyz"], axis=1))


def read_points_npz(content: bytes) -> Soup:
    """Return the array `points` (N, 3) of an NPZ file, or its only array."""
    if not content.startswith(b"PK"):
        raise MeshError("no NPZ file, which is a ZIP archive of arrays")
    try:
        with np.load(io.BytesIO(content), allow_pickle=False) as arrays:
            names = arrays.files
            if "points" not in names and len(names) != 1:
                raise MeshError(f"arrays {', '.join(names) or 'none'}, none of which is `points`")
            name = "points" if "points" in names else names[0]
            _check_header(arrays.zip, name)
            points = arrays[name]
    except MeshError:
        raise
    except (zipfile.BadZipFile, KeyError, EOFError, ValueError) as error:
        raise MeshError("no whole NPZ file") from error
    return _cloud(points.astype(np.float64))


def _check_header(archive: zipfile.ZipFile, name: str) -> None:
    """Check the header of an array before it is unpacked: 2 MB can hold 2 GB of zeros."""
    member = f"{name}.npy" if f"{name}.npy" in archive.namelist() else name
    with archive.open(member) as file:
        head = io.BytesIO(file.read(_NPY_HEADER))
    try:
        version = np.lib.format.read_magic(head)
        read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, _, kind = read(head)
    except ValueError as error:
        raise MeshError("no whole NPZ file") from error
    if len(shape) != 2 or shape[1] != 3 or kind.kind not in "fiu":
        raise MeshError(f"points of shape {shape} and type {kind}; numbers of shape (N, 3) are read")
    if shape[0] > MOST_POINTS:
        raise MeshError(f"{shape[0]} points; at most {MOST_POINTS} are read")


def read_pcd(content: bytes) -> Soup:
    """Return the fields x, y, z of a PCD file, up to version 0.7, without points that are not finite.

    Source: the format's description in the documentation of the Point Cloud Library.
    """
    end = re.search(rb"(?:^|\n)DATA[ \t]+(\w+)[ \t]*\r?\n", content[:100_000])
    if end is None:
        raise MeshError("a PCD file without its header")
    header = _pcd_header(content[: end.start() + 1].decode("ascii", "replace"))
    names, sizes, kinds = header["FIELDS"], _numbers(header, "SIZE"), header["TYPE"]
    counts = _numbers(header, "COUNT") if "COUNT" in header else [1] * len(names)
    many = _numbers(header, "POINTS")[0]
    if not len(names) == len(sizes) == len(kinds) == len(counts):
        raise MeshError("a PCD file with as many FIELDS, SIZE, TYPE and COUNT as each other")
    grid = [_numbers(header, key)[0] for key in ("WIDTH", "HEIGHT") if key in header]
    if len(grid) == 2 and grid[0] * grid[1] != many:
        raise MeshError(f"{grid[0]} times {grid[1]} points where its header says {many}")
    if many > MOST_POINTS:
        raise MeshError(f"{many} points; at most {MOST_POINTS} are read")
    if not {"x", "y", "z"} <= set(names):
        raise MeshError(f"a PCD file with the fields {' '.join(names)}, without x, y, z")
    if any(count != 1 for name, count in zip(names, counts, strict=True) if name in "xyz"):
        raise MeshError("a PCD file with another COUNT than 1 of x, y or z")
    if any((kind, size) not in _PCD_TYPES for kind, size in zip(kinds, sizes, strict=True)):
        raise MeshError("a PCD file with fields of an unknown TYPE or SIZE")
    fields: _Fields = [
        (name if name in "xyz" else f"#{k}", _PCD_TYPES[kind, size], (count,))
        for k, (name, kind, size, count) in enumerate(zip(names, kinds, sizes, counts, strict=True))
    ]
    body, form = content[end.end() :], end.group(1).decode()
    columns = _pcd_columns(form, body, fields, many)
    points = np.stack([np.asarray(columns[axis], np.float64).reshape(many) for axis in "xyz"], axis=1)
    return _cloud(points[np.isfinite(points).all(axis=1)])


_Fields = list[tuple[str, str, tuple[int, ...]]]


def _pcd_columns(form: str, body: bytes, fields: _Fields, many: int) -> dict[str, Array]:
    if form == "ascii":
        check_numbers(body)
        widths = [count for _, _, (count,) in fields]
        values = np.array(body.split(), dtype=np.float64)
        if len(values) != many * sum(widths):
            raise MeshError(f"{len(values)} numbers where its header says {many * sum(widths)}")
        begins = dict(zip((name for name, *_ in fields), np.cumsum([0, *widths[:-1]]), strict=True))
        return {axis: values.reshape(many, -1)[:, begins[axis]] for axis in "xyz"}
    record = np.dtype(fields)
    if form == "binary":
        if len(body) < many * record.itemsize:
            raise MeshError(f"{len(body)} bytes of data where its header says {many * record.itemsize}")
        table = np.frombuffer(body, record, many)
        return {axis: table[axis] for axis in "xyz"}
    if form != "binary_compressed" or len(body) < 8:
        raise MeshError(f"a PCD file with DATA {form}")
    packed, size = (int(number) for number in np.frombuffer(body, "<u4", 2))
    if size != many * record.itemsize or packed > len(body) - 8:
        raise MeshError("compressed data of another size than its header says")
    data, place, columns = _lzf(body[8 : 8 + packed], size), 0, {}
    for name, kind, (count,) in fields:  # one field of all points after another
        columns[name] = np.frombuffer(data, kind, many * count, place)
        place += many * count * np.dtype(kind).itemsize
    return columns


def _pcd_header(text: str) -> dict[str, list[str]]:
    lines = [line.split() for line in text.splitlines() if line.strip() and not line.startswith("#")]
    header = {words[0]: words[1:] for words in lines}
    missing = [key for key in ("FIELDS", "SIZE", "TYPE", "POINTS") if not header.get(key)]
    if missing:
        raise MeshError(f"a PCD file without {', '.join(missing)} in its header")
    return header


def _numbers(header: dict[str, list[str]], key: str) -> list[int]:
    words = header[key]
    if not words or not all(word.isdecimal() and len(word) < 10 for word in words):
        raise MeshError(f"{key} {' '.join(words)[:60]} in the header of a PCD file")
    return [int(word) for word in words]


def _lzf(packed: bytes, size: int) -> bytes:
    """Unpack LibLZF data: literal runs (a byte below 32: its length less 1) and copies of earlier output."""
    out, at, short = bytearray(), 0, "compressed data that ends in the middle"
    while at < len(packed):
        control = packed[at]
        at += 1
        if control < 32:
            out += packed[at : at + control + 1]
            at += control + 1
            continue
        length, far = control >> 5, (control & 31) << 8
        if length == 7:
            length, at = length + _byte(packed, at, short), at + 1
        far, at = far + _byte(packed, at, short) + 1, at + 1
        length += 2
        begin = len(out) - far
        if begin < 0 or len(out) + length > size:
            raise MeshError("compressed data that refers to what is not there")
        piece = out[begin : begin + length]
        out += (piece * (length // len(piece) + 1))[:length]
    if len(out) != size:
        raise MeshError(short)
    return bytes(out)


def _byte(data: bytes, at: int, short: str) -> int:
    if at >= len(data):
        raise MeshError(short)
    return data[at]


def _cloud(points: Array) -> Soup:
    """Return points without triangles, each once, in a fixed order."""
    if len(points) > MOST_POINTS:
        raise MeshError(f"{len(points)} points; at most {MOST_POINTS} are read")
    if not np.isfinite(points).all():
        raise MeshError("a coordinate that is not a finite number")
    if len(points) == 0:
        raise MeshError("no points")
    return Soup(np.unique(points + 0.0, axis=0), np.empty((0, 3), np.int64))
