"""Samples of a motion as other programs write them: JSON with `t`, `q`, `v`, `a`, or CSV with named columns."""

import csv
import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from optiplan.arrays import Array
from optiplan.errors import InputError, Issue, os_reason
from optiplan.files import parsed_json, read_bytes
from optiplan.records import dataclass
from optiplan.trajectory.from_samples import from_samples, interpolation
from optiplan.trajectory.pieces import joint_names_in, json_array
from optiplan.trajectory.trajectory import Trajectory

_KINDS = ("q", "v", "a")
_HEADER = "t, then NAME or q_NAME of each joint, and optionally v_NAME and a_NAME"


@dataclass(frozen=True, eq=False)
class Samples:
    """States at times: `t` (k,), s; `q`, `v`, `a` (k, n) in rad or m and s; v and a may be None.

    `file` is where they were read; shapes need not fit each other, since files may hold anything.
    """

    joint_names: tuple[str, ...]
    t: Array
    q: Array
    v: Array | None = None
    a: Array | None = None
    file: str = "samples"

    @property
    def interpolation(self) -> str:
        """Interpolation that `trajectory` uses between samples, and a first time that is not 0, in words."""
        words = interpolation(self.v, self.a)
        first = float(self.t.flat[0]) if self.t.size else 0.0
        return words if first == 0.0 else f"{words}; times are counted from the first one, {first:g} s"

    def trajectory(self) -> Trajectory:
        """The motion through them.

        Raises:
            InputError: they are no motion: shapes, times that do not increase, numbers that are not finite.
        """
        try:
            return from_samples(self.joint_names, self.t, self.q, self.v, self.a)
        except ValueError as error:
            field, found, expected = str(error).replace("; expected ", ": found ", 1).split(": found ", 2)
            raise InputError([Issue(self.file, None, field, found, expected)]) from None


def read_samples(path: Path, joint_names: Sequence[str] | None = None) -> Samples:
    """Read a CSV (suffix .csv) or JSON file of samples.

    Args:
        path: the file.
        joint_names: order of the columns of the answer, if the file has just these joints; and their names, if a JSON
            file names none.

    Raises:
        InputError: naming file, line and field of what cannot be read.
    """
    try:
        text = read_bytes(path).decode("utf-8-sig")
    except OSError as error:
        found = os_reason(error)
        raise InputError([Issue(str(path), None, "file", found, "a file of samples")]) from error
    except ValueError as error:
        raise InputError([Issue(str(path), None, "file", "no UTF-8 text", "CSV or JSON")]) from error
    if path.suffix.lower() == ".csv":
        return _ordered(_of_csv(text, str(path)), joint_names)
    try:
        data = parsed_json(text)
    except (ValueError, RecursionError) as error:
        line, why = (error.lineno, error.msg) if isinstance(error, json.JSONDecodeError) else (None, "not readable")
        found, expected = f"broken JSON ({why})", "JSON with t, q, and perhaps v, a"
        raise InputError([Issue(str(path), line, "file", found, expected)]) from error
    return samples_from_dict(data, str(path), joint_names)


def samples_from_dict(data: Any, file: str, joint_names: Sequence[str] | None = None) -> Samples:
    """Samples of parsed JSON; arguments and errors as `read_samples`."""
    if not isinstance(data, Mapping) or data.get("t") is None or data.get("q") is None:
        raise InputError([Issue(file, None, "t, q", "nothing", "times t and positions q")])
    names = joint_names_in(data, file, None if joint_names is None else list(joint_names))
    given = {key: json_array(data[key], file, key) for key in ("t", *_KINDS) if data.get(key) is not None}
    return _ordered(Samples(tuple(names), **given, file=file), joint_names)


def csv_rows(text: str, file: str) -> list[tuple[int, list[str]]]:
    """Return the rows of a CSV file that are not empty, with their lines.

    Raises:
        InputError: it is no CSV.
    """
    reader = csv.reader(text.splitlines())
    try:
        return [(reader.line_num, row) for row in reader if any(cell.strip() for cell in row)]
    except csv.Error as error:
        raise InputError([Issue(file, reader.line_num, "row", str(error), "cells between commas")]) from None


def _of_csv(text: str, file: str) -> Samples:
    rows = csv_rows(text, file)
    at, header = rows[0] if rows else (1, [])
    header = [cell.strip() for cell in header]
    if not header or header[0] not in ("t", "time") or len(header) < 2 or len(set(header)) < len(header):
        raise InputError([Issue(file, at, "header", ", ".join(header)[:120] or "nothing", _HEADER)])
    values = []
    for line, row in rows[1:]:
        try:
            values.append([_number(cell) for cell in row])
        except ValueError as error:
            raise InputError([Issue(file, line, "row", str(error), "numbers")]) from None
        if len(row) != len(header):
            raise InputError([Issue(file, line, "row", f"{len(row)} numbers", f"{len(header)}, as the header has")])
    table = np.array(values, dtype=float).reshape(-1, len(header))
    columns: dict[str, dict[str, int]] = {kind: {} for kind in _KINDS}
    for k, name in enumerate(header[1:], 1):
        kind, joint = (name[0], name[2:]) if name[:2] in ("q_", "v_", "a_") else ("q", name)
        if joint in columns[kind]:  # another program may play the other one
            found = f"two columns for {joint}: {header[columns[kind][joint]]}, {name}"
            raise InputError([Issue(file, at, "header", found[:120], _HEADER)])
        columns[kind][joint] = k
    names = tuple(columns["q"])
    for kind in ("v", "a"):
        if columns[kind] and set(columns[kind]) != set(names):
            found = f"{kind} of {', '.join(columns[kind])}"
            raise InputError([Issue(file, at, "header", found, f"those of {', '.join(names) or 'all joints'}")])
    parts = {kind: table[:, [columns[kind][name] for name in names]] for kind in _KINDS if columns[kind]}
    if "q" not in parts:
        raise InputError([Issue(file, at, "header", ", ".join(header)[:120], _HEADER)])
    return Samples(names, table[:, 0], **parts, file=file)


def _number(cell: str) -> float:
    """Return the number of a cell as CSV files write it: no `1_000` and no digits of other scripts, as Python takes.

    Raises:
        ValueError: it is none.
    """
    if "_" in cell or not cell.isascii():
        raise ValueError(f"'{cell[:40]}'")
    return float(cell)


def _ordered(samples: Samples, joint_names: Sequence[str] | None) -> Samples:
    """With columns in this order, where the joints are the same."""
    names = samples.joint_names
    if joint_names is None or names == tuple(joint_names) or sorted(names) != sorted(joint_names):
        return samples
    order = [names.index(name) for name in joint_names]
    parts = {kind: getattr(samples, kind) for kind in _KINDS}
    if any(x is not None and x.shape[1:] != (len(names),) for x in parts.values()):
        return samples
    turned = {kind: x[:, order] for kind, x in parts.items() if x is not None}
    return replace(samples, joint_names=tuple(joint_names), **turned)
