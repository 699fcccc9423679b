"""Targets of a tour from a CSV file."""

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from optiplan.errors import InputError, Issue
from optiplan.files import read_bytes
from optiplan.problem.schema.tour import TARGET_COLUMNS, TargetSpec

MOST = 10_000
"""Targets of a tour."""

_TEXTS = ("name", "cluster", "after")


def targets_data(targets: Any, base: Path) -> list[dict[str, Any]]:
    """Return targets as a problem file lists them, those of a CSV file relative to `base` too.

    Raises:
        InputError: as `read_targets`.
    """
    if not isinstance(targets, str):
        return [dict(one) for one in targets]
    return [one.model_dump(mode="json", exclude_none=True) for one in read_targets(base / targets)]


def read_targets(file: Path) -> list[TargetSpec]:
    """Return the targets of a CSV file, one a row, whose first row names the columns (`TARGET_COLUMNS`).

    Several names in `after` are separated by spaces or semicolons. Empty cells are as if the column were not there.

    Raises:
        InputError: it cannot be read, or its rows are no targets; with line and column.
    """
    try:
        text = read_bytes(file).decode("utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        why = (error.strerror or str(error)).lower() if isinstance(error, OSError) else "not UTF-8 text"
        raise InputError([Issue(str(file), None, "targets", why, "a CSV file of targets")]) from None
    rows = list(csv.reader(text.splitlines()))
    header = [name.strip() for name in rows[0]] if rows else []
    known = [name for names in TARGET_COLUMNS.values() for name in names]
    issues = [
        Issue(str(file), 1, f"column {k + 1}", f"'{name}'", f"one of {', '.join(known)}")
        for k, name in enumerate(header)
        if name not in known or header.index(name) < k
    ]
    issues += _incomplete(file, header)
    if not issues and not 1 < len(rows) <= MOST + 1:
        issues = [Issue(str(file), None, "targets", f"{len(rows) - 1} rows", f"1 to {MOST} targets, one a row")]
    found: list[TargetSpec] = []
    for line, row in enumerate(rows[1:], 2) if not issues else ():
        if any(cell.strip() for cell in row):
            target = _target(file, line, header, row)
            found += [target] if isinstance(target, TargetSpec) else []
            issues += [target] if isinstance(target, Issue) else []
    if issues:
        raise InputError(issues)
    return found


def _incomplete(file: Path, header: Sequence[str]) -> list[Issue]:
    """Report columns without those that belong to them."""
    issues = []
    for key, names in TARGET_COLUMNS.items():
        missing = [name for name in names if name not in header]
        if missing and (len(missing) < len(names) or key == "position"):
            found = f"no column {', '.join(missing)}"
            issues.append(Issue(str(file), 1, key, found, f"the columns {', '.join(names)}"))
    return issues


def _target(file: Path, line: int, header: Sequence[str], row: Sequence[str]) -> TargetSpec | Issue:
    if len(row) != len(header):
        found = f"{len(row)} cells"
        return Issue(str(file), line, "row", found, f"{len(header)} cells, one for each of {', '.join(header)}")
    cells = {name: cell.strip() for name, cell in zip(header, row, strict=True)}
    data: dict[str, Any] = {}
    for key, names in TARGET_COLUMNS.items():
        values = [cells.get(name, "") for name in names]
        if not any(values):
            continue
        if key in _TEXTS:
            data[key] = values[0].replace(";", " ").split() if key == "after" else values[0]
            continue
        try:
            data[key] = [float(value) for value in values]
        except ValueError:
            return Issue(str(file), line, ", ".join(names), ", ".join(map(repr, values)), "numbers")
    try:
        return TargetSpec.model_validate(data)
    except ValidationError as error:
        return _issue(file, line, error.errors()[0])


def _issue(file: Path, line: int, error: Mapping[str, Any]) -> Issue:
    field = ".".join(map(str, error["loc"])) or "row"
    words = str(error["msg"]).removeprefix("Value error, ")
    found, _, expected = words.removeprefix("found ").partition("; expected ")
    if expected:
        return Issue(str(file), line, field, found, expected)
    return Issue(str(file), line, field, repr(error.get("input"))[:60], words)
