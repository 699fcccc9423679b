"""Rows of a CSV file whose first row names the columns: each a value of one kind, checked."""

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar

from pydantic import BaseModel, ValidationError

from optiplan.errors import InputError, Issue
from optiplan.files import read_bytes

MOST = 10_000
"""Rows of a file."""

Row = TypeVar("Row", bound=BaseModel)


@dataclass(frozen=True)
class RowsOf(Generic[Row]):
    """The content of a file.

    Attributes:
        kind: of a row.
        columns: names of the columns that hold the value of each key; those of `position` are required.
        words: what the rows are.
        texts: keys whose one cell is a text; those of `lists` are several names, with semicolons between.
        least: rows.
    """

    kind: type[Row]
    columns: Mapping[str, tuple[str, ...]]
    words: str
    texts: tuple[str, ...] = ()
    lists: tuple[str, ...] = ()
    least: int = 1


def read_rows(file: Path, of: RowsOf[Row]) -> list[Row]:
    """Return the rows of a file. Empty cells are as if the column were not there, and so are empty rows.

    Raises:
        InputError: it cannot be read, or a row is not what it should be; with line and column.
    """
    try:
        text = read_bytes(file).decode("utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        why = (error.strerror or str(error)).lower() if isinstance(error, OSError) else "not UTF-8 text"
        raise InputError([Issue(str(file), None, of.words, why, f"a CSV file of {of.words}")]) from None
    rows = list(csv.reader(text.splitlines()))
    header = [name.strip() for name in rows[0]] if rows else []
    known = [name for names in of.columns.values() for name in names]
    issues = [
        Issue(str(file), 1, f"column {k + 1}", f"'{name}'", f"one of {', '.join(known)}")
        for k, name in enumerate(header)
        if name not in known or header.index(name) < k
    ]
    issues += _incomplete(file, header, of.columns)
    if not issues and not of.least < len(rows) <= MOST + 1:
        expected = f"{of.least} to {MOST} {of.words}, one a row"
        issues = [Issue(str(file), None, of.words, f"{len(rows) - 1} rows", expected)]
    found: list[Row] = []
    for line, row in enumerate(rows[1:], 2) if not issues else ():
        if any(cell.strip() for cell in row):
            one = _row(file, line, (header, row), of)
            found += [] if isinstance(one, Issue) else [one]
            issues += [one] if isinstance(one, Issue) else []
    if issues:
        raise InputError(issues)
    return found


def _incomplete(file: Path, header: Sequence[str], columns: Mapping[str, tuple[str, ...]]) -> list[Issue]:
    """Report columns without those that belong to them."""
    issues = []
    for key, names in columns.items():
        missing = [name for name in names if name not in header]
        if missing and (len(missing) < len(names) or key == "position"):
            found = f"no column {', '.join(missing)}"
            issues.append(Issue(str(file), 1, key, found, f"the columns {', '.join(names)}"))
    return issues


def _row(file: Path, line: int, cells_of: tuple[Sequence[str], Sequence[str]], of: RowsOf[Row]) -> Row | Issue:
    header, row = cells_of
    if len(row) != len(header):
        found = f"{len(row)} cells"
        return Issue(str(file), line, "row", found, f"{len(header)} cells, one for each of {', '.join(header)}")
    cells = {name: cell.strip() for name, cell in zip(header, row, strict=True)}
    data: dict[str, Any] = {}
    for key, names in of.columns.items():
        values = [cells.get(name, "") for name in names]
        if not any(values):
            continue
        if key in of.texts or key in of.lists:
            listed = [name.strip() for name in values[0].split(";")]
            data[key] = [name for name in listed if name] if key in of.lists else values[0]
            continue
        try:
            data[key] = [float(value) for value in values]
        except ValueError:
            return Issue(str(file), line, ", ".join(names), ", ".join(map(repr, values)), "numbers")
    try:
        return of.kind.model_validate(data)
    except ValidationError as error:
        return _issue(file, line, error.errors()[0])


def _issue(file: Path, line: int, error: Mapping[str, Any]) -> Issue:
    field = ".".join(map(str, error["loc"])) or "row"
    words = str(error["msg"]).removeprefix("Value error, ")
    found, _, expected = words.removeprefix("found ").partition("; expected ")
    if expected:
        return Issue(str(file), line, field, found, expected)
    return Issue(str(file), line, field, repr(error.get("input"))[:60], words)
