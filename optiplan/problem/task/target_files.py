"""Targets of a tour from a CSV file."""

from pathlib import Path
from typing import Any

from optiplan.problem.schema.tour import TARGET_COLUMNS, TargetSpec
from optiplan.problem.task.csv_rows import LocatedRow, RowsOf, read_rows

_ROWS = RowsOf(TargetSpec, TARGET_COLUMNS, "targets", ("name", "cluster"), ("after",))


def targets_data(targets: Any, base: Path) -> list[dict[str, Any]]:
    """Return targets as a problem file lists them, those of a CSV file relative to `base` too.

    Raises:
        InputError: as `read_targets`.
    """
    if not isinstance(targets, str):
        return [dict(one) for one in targets]
    return [one.row.model_dump(mode="json", exclude_none=True) for one in read_targets(base / targets)]


def read_targets(file: Path) -> list[LocatedRow[TargetSpec]]:
    """Return the targets of a CSV file, one a row, whose first row names the columns (`TARGET_COLUMNS`).

    Several names in `after` are separated by semicolons: names may have spaces.

    Raises:
        InputError: it cannot be read, or its rows are no targets; with line and column.
    """
    return read_rows(file, _ROWS)
