"""Rows of a CSV file whose first row names the columns: each a value of one kind, checked."""

import csv
from collections.abc import Iterator, Mapping, Sequence
from math import isfinite
from pathlib import Path
from typing import Any, Generic, NamedTuple, TypeVar

from pydantic import BaseModel, ValidationError

from optiplan.config.messages import words_for
from optiplan.errors import InputError, Issue, os_reason
from optiplan.files import read_bytes
from optiplan.records import dataclass

MOST = 10_000
"""Rows of a file."""

Row = TypeVar("Row", bound=BaseModel)


class LocatedRow(NamedTuple, Generic[Row]):
    """A row, and the line of the file on which it begins."""

    line: int
    row: Row


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


def read_rows(file: Path, of: RowsOf[Row]) -> list[LocatedRow[Row]]:
    """Return the rows of a file. Empty cells are as if the column were not there, and so are empty rows.

    Raises:
        InputError: it cannot be read, or a row is not what it should be; with line and column.
    """
    try:
        text = read_bytes(file).decode("utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        why = os_reason(error) if isinstance(error, OSError) else "not UTF-8 text"
        raise InputError([Issue(str(file), None, of.words, why, f"a CSV file of {of.words}")]) from None
    rows = list(_records(file, text))
    header = [name.strip() for name in rows[0][1]] if rows else []
    known = [name for names in of.columns.values() for name in names]
    issues = [
        Issue(str(file), 1, f"column {k + 1}", f"'{name}'", f"one of {', '.join(known)}")
        for k, name in enumerate(header)
        if name not in known or header.index(name) < k
    ]
    issues += _incomplete(file, header, of.columns)
    filled = [(line, row) for line, row in rows[1:] if any(cell.strip() for cell in row)]
    if not issues and not of.least <= len(filled) <= MOST:
        expected = f"{of.least} to {MOST} {of.words}, one a row"
        issues = [Issue(str(file), None, of.words, f"{len(filled)} rows", expected)]
    found: list[LocatedRow[Row]] = []
    for line, row in filled if not issues else ():
        one = _row(file, line, (header, row), of)
        found += [] if isinstance(one, Issue) else [LocatedRow(line, one)]
        issues += [one] if isinstance(one, Issue) else []
    if issues:
        raise InputError(issues)
    return found


def _records(file: Path, text: str) -> Iterator[tuple[int, list[str]]]:
    """Yield each row with the line on which it begins; a cell between quotes may have several lines.

    Raises:
        InputError: quotes that are not closed, or end within a cell.
    """
    reader, line = csv.reader(text.splitlines(keepends=True), strict=True), 1
    while True:
        try:
            row = next(reader)
        except StopIteration:
            return
        except csv.Error as error:
            found = "a quote that is not closed" if "end of data" in str(error) else "a quote within a cell"
            expected = "cells in quotes or without any; a quote in a cell in quotes is doubled"
            raise InputError([Issue(str(file), line, "row", found, expected)]) from None
        yield line, row
        line = reader.line_num + 1


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
        if not all(map(isfinite, data[key])):
            return Issue(str(file), line, ", ".join(names), ", ".join(map(repr, values)), "finite numbers")
    try:
        return of.kind.model_validate(data)
    except ValidationError as error:
        first = error.errors()[0]
        return Issue(str(file), line, ".".join(map(str, first["loc"])) or "row", *words_for(of.kind, first))
